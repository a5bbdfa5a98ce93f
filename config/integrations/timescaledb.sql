-- After postgresql.sql, in the same database: `wind` as a hypertable of TimescaleDB (docs/integrations/postgresql.md).
-- Its server must load the library: shared_preload_libraries = 'timescaledb'.

CREATE EXTENSION IF NOT EXISTS timescaledb;

-- A unique key of a hypertable must contain its time.
ALTER TABLE wind DROP CONSTRAINT wind_pkey;
ALTER TABLE wind ADD PRIMARY KEY (site, line, device, boot, seq, time);
SELECT create_hypertable('wind', 'time', migrate_data => true);

-- Samples of more than 90 days, a chunk at a time: SELECT drop_chunks('wind', older_than => interval '90 days');
