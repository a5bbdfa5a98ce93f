/* What the paced line counts, and how it tells it: one JSON object a window. */
#ifndef BENCH_JUDGE_H
#define BENCH_JUDGE_H

#include "rtu.h"

/* A sender that begins just after the first byte of a late answer may have looked just before it. */
#define LAST_LOOK (1 * NS_PER_MS)

struct judge {
    int64_t begun;                       /* of this window */
    long requests;                       /* frames begun by the master */
    long heard, answered, unanswered;    /* heard = in time, whole, right check; unanswered = absent or dead */
    long too_early, pauses;              /* unheard: begun before t3.5, or a pause above t1.5 inside */
    long last_look, collided;            /* unheard, but nobody could have known: see wire_surprising */
    long bad_frames, wrong_rate;         /* unheard: the check or the rate is wrong */
    long crc, truncated, garbage, late;  /* answers spoilt or delayed on purpose */
    long garbled;                        /* answers destroyed by a collision */
    int64_t first_answer, last_answer;   /* end of the first and the last answer of this window */
    struct series gaps;                  /* silence before each request */
    struct series pace;                  /* how late each byte was handed over, against its due time */
};

void judge_begin(struct judge *judge, int64_t now);
void judge_print(FILE *out, struct judge *judge, int64_t now, int64_t t35, bool fifo);

#endif
