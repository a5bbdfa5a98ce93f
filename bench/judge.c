#include "judge.h"

#include <string.h>

void judge_begin(struct judge *judge, int64_t now) {
    struct series gaps = judge->gaps, pace = judge->pace;
    memset(judge, 0, sizeof *judge);
    judge->gaps = gaps;
    judge->pace = pace;
    judge->gaps.n = judge->pace.n = 0;
    judge->begun = now;
}

/* How far above (or below) t3.5 the gaps are: upper bounds in us, each gap counted once. */
static void histogram_print(FILE *out, const struct series *gaps, int64_t t35) {
    static const long bounds[] = {0, 50, 100, 200, 500, 1000, 2000, 5000, 20000};
    enum { BOUNDS = sizeof bounds / sizeof *bounds };
    long counts[BOUNDS + 1] = {0};
    for (size_t i = 0; i < gaps->n; i++) {
        int64_t above = gaps->items[i] - t35;
        int bucket = 0;
        while (bucket < BOUNDS && above >= bounds[bucket] * 1000) bucket++;
        counts[bucket]++;
    }
    fprintf(out, "{");
    for (int i = 0; i < BOUNDS; i++) fprintf(out, "\"<%ld\":%ld,", bounds[i], counts[i]);
    fprintf(out, "\">=%ld\":%ld}", bounds[BOUNDS - 1], counts[BOUNDS]);
}

void judge_print(FILE *out, struct judge *judge, int64_t now, int64_t t35, bool fifo) {
    int64_t span = judge->last_answer - judge->first_answer;
    fprintf(out, "{\"seconds\":%.6f,\"fifo\":%s,\"requests\":%ld,\"heard\":%ld,\"answered\":%ld,\"unanswered\":%ld,",
            seconds(now - judge->begun), fifo ? "true" : "false", judge->requests, judge->heard, judge->answered,
            judge->unanswered);
    fprintf(out, "\"too_early\":%ld,\"pauses\":%ld,\"last_look\":%ld,\"collided\":%ld,\"bad_frames\":%ld,\"wrong_rate\":%ld,",
            judge->too_early, judge->pauses, judge->last_look, judge->collided, judge->bad_frames, judge->wrong_rate);
    fprintf(out, "\"crc\":%ld,\"truncated\":%ld,\"garbage\":%ld,\"late\":%ld,\"garbled\":%ld,", judge->crc,
            judge->truncated, judge->garbage, judge->late, judge->garbled);
    fprintf(out, "\"answers_per_s\":%.4f,\"t35_us\":%.1f,\"gap_us\":",
            span > 0 ? (double)(judge->answered - 1) / seconds(span) : 0.0, us(t35));
    series_print(out, &judge->gaps);
    fprintf(out, ",\"above_t35_us\":");
    histogram_print(out, &judge->gaps, t35);
    fprintf(out, ",\"pace_us\":");
    series_print(out, &judge->pace);
    fprintf(out, "}\n");
    fflush(out);
}
