-- Tables for lfs10d in PostgreSQL (docs/integrations/postgresql.md): psql -d wind -f postgresql.sql
-- Telegraf copies into wind_in and wind_record_in. Their triggers keep each sample and each record once.

CREATE TABLE wind (
  site text NOT NULL,           -- the base topic: which gateway, where several write into one database
  line text NOT NULL,
  device text NOT NULL,
  boot text NOT NULL,
  seq bigint NOT NULL,
  time timestamptz NOT NULL,
  wind_speed double precision,  -- null: the poll failed, `error` says why; never 0
  wind_direction double precision,
  quality text NOT NULL,
  error text,
  clock text NOT NULL,
  rtt_ms double precision,
  PRIMARY KEY (site, line, device, boot, seq)
);
CREATE INDEX wind_by_time ON wind (site, line, device, time);

CREATE TABLE wind_record (
  site text NOT NULL,
  line text NOT NULL,
  device text NOT NULL,
  boot text NOT NULL,
  seq bigint NOT NULL,
  begins timestamptz NOT NULL,  -- the record is of [begins, time)
  time timestamptz NOT NULL,
  mean double precision,        -- null: less than half of the span is covered
  gust double precision,
  lull double precision,
  max double precision,
  stddev double precision,
  direction double precision,
  direction_stddev double precision,
  samples integer NOT NULL,
  coverage double precision NOT NULL,
  clock text NOT NULL,
  PRIMARY KEY (site, line, device, boot, seq)
);
CREATE INDEX wind_record_by_time ON wind_record (site, line, device, time);

-- What Telegraf copies: all numbers of JSON are double precision there. These two tables stay empty.

CREATE TABLE wind_in (
  time timestamptz, site text, line text, device text, boot text, seq double precision,
  wind_speed double precision, wind_direction double precision, quality text, error text, clock text,
  rtt_ms double precision
);

CREATE TABLE wind_record_in (
  time timestamptz, site text, line text, device text, boot text, seq double precision, "from" double precision,
  mean double precision, gust double precision, lull double precision, max double precision, stddev double precision,
  direction double precision, direction_stddev double precision, samples double precision, coverage double precision,
  clock text
);

CREATE FUNCTION wind_once() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO wind VALUES (NEW.site, NEW.line, NEW.device, NEW.boot, NEW.seq, NEW.time, NEW.wind_speed,
    NEW.wind_direction, NEW.quality, NEW.error, NEW.clock, NEW.rtt_ms)
  ON CONFLICT DO NOTHING;
  RETURN NULL;
END $$;

CREATE FUNCTION wind_record_once() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO wind_record VALUES (NEW.site, NEW.line, NEW.device, NEW.boot, NEW.seq, to_timestamp(NEW."from" / 1000),
    NEW.time, NEW.mean, NEW.gust, NEW.lull, NEW.max, NEW.stddev, NEW.direction, NEW.direction_stddev, NEW.samples,
    NEW.coverage, NEW.clock)
  ON CONFLICT DO NOTHING;
  RETURN NULL;
END $$;

CREATE TRIGGER wind_once BEFORE INSERT ON wind_in FOR EACH ROW EXECUTE FUNCTION wind_once();
CREATE TRIGGER wind_record_once BEFORE INSERT ON wind_record_in FOR EACH ROW EXECUTE FUNCTION wind_record_once();
