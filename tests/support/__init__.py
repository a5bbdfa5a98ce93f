"""Test doubles and rigs: which module serves which level, from bytes on a wire to processes and a browser.

The wire (`modbus`)
    `exchanges`          an exchange in virtual time: the request, bytes for it, a shell that carries it out
    `receptions`         bytes received in pieces, sorted into replies and noise
    `pending_lines`      requests that are still unanswered, and what happens to them
    `doubted_slaves`     a slave whose exchanges are told one by one to those who doubt answers
    `late_readers`       random lines with second answers, read late, and what was published wrongly of them
    `outcomes`           outcomes of exchanges, for tests of what receives them
    `ports`              a serial port on a pty
    `far_end`            the device's end of that pty
    `plain_wire`         RTU's checksum and a simple master, written apart from the product: a reference for `bench`
    `terminals`          the master's end of the bench's paced line

The simulator
    `simulated`          a simulated line, asked byte by byte
    `virtual_port`       the master's port on it in virtual time, and what drives a master through that
    `faulty_sensors`     faults of a simulated sensor, its power, and which of its replies may be believed
    `queued_sensor`      a simulated sensor that answers one request after the other, however late
    `sensor_values`      wind speeds in the replies of a simulated sensor

One line, without broker and daemon (`line`)
    `lines`              a whole line in virtual time: poller, bus and simulated sensors
    `schedules`          a scheduler alone, with slaves that are silent
    `identifications`    an identification, and the outcomes that it gets
    `scans`              a scan on a simulated line
    `second_masters`     a second master that comes and goes
    `register_accesses`  register access on a simulated line

Profiles, configuration and files
    `any_profiles`       profiles with values of every type, for laws (hypothesis)
    `documents`          YAML documents, and the problems found in them
    `config_texts`       configuration files as text: the smallest, loaded, its problems
    `merges`             entries of a configuration file with the defaults filled in
    `json_schema`        a validator for JSON Schema, as an editor has one
    `volatile_disk`      files in memory that lose at a power cut what was not synced
    `log_records`        log records

Physical changes of sensors (`reconfiguration`)
    `sensors`            sensors that answer a procedure or a job exchange by exchange, without a line
    `recognitions`       a recognition, and the sensors that it looks at
    `lives`              reconfiguration on a simulated line: a daemon's life, its crash, its next life
    `newcomers`          such a line, into which a new sensor is plugged
    `story`              requests, faults, crashes and power cuts in any order, for laws (hypothesis)
    `happenings`         what happens in one but requests
    `story_steps`        what can happen in one, for hypothesis to draw from
    `ails`               the faults of sensors in a story
    `foreigners`         devices in a story that are not to be written to, and count how often they are

What is published (`telemetry`)
    `stations`           a station, and readings for it
    `device_states`      the state of one device, fed with readings at given times
    `counted`            exchanges and readings for the counters
    `samples`            a good sample
    `winds`              devices that measure wind, and readings of them
    `naive_wind`         wind statistics straight from their definitions: a reference
    `homeassistant_keys`   what Home Assistant accepts in a discovery payload
    `homeassistant_units`  the units that Home Assistant accepts

The outbox and its store (`outbox`)
    `outbox_items`       items of the outbox
    `outboxes`           an outbox in virtual time
    `backlogs`           a backlog with a store in memory
    `spoolers`           a spooler with a real store, on a loop whose clock the test moves
    `stores`             a store and its files
    `sample_files`       a file of samples: written, read, opened again
    `rows`               samples and entries as the store takes them

The broker (`mqtt`)
    `reconnects`         a plan of connections, and how they end
    `senders`            a sender between an outbox and a connection, in virtual time
    `discoveries`        Home Assistant's discovery at a broker in memory
    `virtual_loop`       an asyncio loop in virtual time
    `broker_clients`     a real broker client, and a record of what it reports
    `uplinks`            an uplink at a real mosquitto
    `brokers`            a real mosquitto, a listener to it, and certificates
    `answering_brokers`  a broker that refuses messages as the test says
    `old_brokers`        brokers that reply with given bytes; one of 2014, MQTT 3.1.1 only
    `delaying_proxy`     a slow network between client and broker

Requests (`commands`)
    `admissions`         an admission, and requests for it
    `dispatchers`        a dispatcher with handlers of the test
    `context`            what a handler may use, without a daemon
    `device_requests`    a device and a profile for requests on devices

Verbs (`cli`) in this process
    `verbs`              types of the fixtures that call a verb
    `live_states`        what the live view receives

The daemon and its verbs as processes
    `sites`              a daemon on a simulated line, and what it publishes
    `forked`             lfs10d as a process that starts fast: forked from one that has imported it
    `operators`          an MQTT client that sends requests to a daemon
    `shells`             verbs as processes, in a pipe or on a terminal
    `recordings`         lines of other devices, and all that a daemon published of them

The page (`web`)
    `pages`              the page's server in a thread, fed by the test
    `page_states`        states of the page, made without a daemon
    `page_acts`          states of the page that a person or the browser brings about
    `chromium`           Debian's chromium, driven by playwright
    `live_pages`         everything: a simulated line, mosquitto, the daemon, the page's server and chromium

All tests
    `sharing`            which worker runs which tests
"""
