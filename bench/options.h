/* What the paced line is told on its command line. */
#ifndef BENCH_OPTIONS_H
#define BENCH_OPTIONS_H

#include "rtu.h"

enum { ANY_ID = 256 };

struct options {
    int sensors;
    long baudrate;
    const char *link, *log;
    int64_t turnaround, die_after, late_by, latency; /* ns */
    bool dead[ANY_ID], echo, fifo;
    double noise, late; /* percent of the answers */
    uint64_t seed;
};

void read_options(struct options *options, int argc, char **argv); /* exits 2 on a wrong one */

#endif
