"""Physical changes of sensors (slave id, baud rate, a new sensor): journalled, verified, completed or rolled back.

The order of steps, each on the disk before the next begins: intent in the journal, write, verification, the fact in
`changes.yaml`, the journal closed, the answer. A change that the daemon did not live to finish is followed at the
next start until its sensor is found; its request is answered then.
"""
