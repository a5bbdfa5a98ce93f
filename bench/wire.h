/* The pair of wires: who talks when, and what the master's adapter hands over. */
#ifndef BENCH_WIRE_H
#define BENCH_WIRE_H

#include "judge.h"

enum kind { KIND_OK, KIND_CRC, KIND_TRUNCATED, KIND_GARBAGE, KIND_LATE, KIND_STALE, KIND_GARBLED, KIND_ECHO };
/* LATE was delayed on purpose; STALE too, and the master began something else in the meantime: it may believe
 * the first, never the second. */
extern const char *const KIND_NAMES[];

/* Bytes that one sender puts on the line, one after the other, from `start` on. */
struct talk {
    uint8_t bytes[64];
    int n, sent;
    long baudrate;
    int64_t start;
    enum kind kind;
    int slave;
    bool late;               /* delayed on purpose: the master cannot know when it comes */
    bool carries_value;
    uint32_t value;          /* the bits of the float32 sent */
    int64_t requested;       /* when its request began */
};

enum { MAX_TALKS = 512, ADAPTER_ROOM = 62 };

struct wire {
    int master;              /* our end of the pseudo terminal */
    FILE *log;               /* one line for each value sent, or NULL */
    struct judge *judge;
    int64_t quiet_since;     /* end of the last byte on the line, wanted or not */
    int64_t broken_at;       /* when the first byte after the last silence became readable for the master */
    bool broken_by_late;     /* and that it was of a late answer */
    int64_t sending_from, sending_to; /* the master's own frame on the line */
    bool request_hit;        /* a talk began inside that frame */
    struct talk talks[MAX_TALKS];
    int n_talks;
    int64_t latency;         /* of the adapter; 0: every byte at once */
    int64_t adapter_epoch, adapter_since; /* when its timer began; when its oldest waiting byte came */
    uint8_t adapter[ADAPTER_ROOM];
    int n_adapter;
};

void wire_say(struct wire *wire, const struct talk *talk);
bool wire_talking(const struct wire *wire, int64_t now);
/* A master that begins now cannot have known that the line is not silent. */
bool wire_surprising(const struct wire *wire, int64_t now);
/* The master began to send over whatever is in the air: what is left of it is destroyed. */
void wire_trample(struct wire *wire, int64_t now);
/* The master began to send: answers it no longer waits for are stale. */
void wire_overtake(struct wire *wire);
int64_t wire_due(const struct wire *wire); /* when the next byte or piece is due; INT64_MAX: nothing is */
void wire_deliver(struct wire *wire);      /* hand over everything due by now */

#endif
