-- The 10-minute table of a sensor, newest first. A span without a good sample is there, with nulls and coverage 0.
SELECT begins, mean, gust, lull, stddev, round((100 * coverage)::numeric) AS percent
FROM wind_record
WHERE device = 'mast-top'
ORDER BY begins DESC
LIMIT 144;

-- The wind rose of 30 days: an anemometer's means by the direction of a vane. Sector 0 is north, 4 east, 8 south.
SELECT round(vane.direction / 22.5)::integer % 16 AS sector,
       width_bucket(speed.mean, ARRAY[0.5, 3, 6, 9, 12, 15]) AS class,
       round(100.0 * count(*) / sum(count(*)) OVER (), 1) AS percent
FROM wind_record AS speed
JOIN wind_record AS vane USING (site, line, begins)
WHERE speed.device = 'mast-top' AND vane.device = 'vane' AND vane.direction IS NOT NULL
  AND speed.mean IS NOT NULL AND begins > now() - interval '30 days'
GROUP BY sector, class
ORDER BY sector, class;

-- What is missing: seq has no holes per device and boot, so each row here is a hole, with the samples it lacks.
SELECT site, line, device, boot, seq - before - 1 AS missing, time
FROM (SELECT *, lag(seq) OVER (PARTITION BY site, line, device, boot ORDER BY seq) AS before FROM wind) AS samples
WHERE seq - before > 1;
