/* Modbus RTU in a few lines, for the bench's own programs: times, check, clock, priority.
 *
 * Written apart from the daemon on purpose: what judges a master must not share its arithmetic.
 */
#ifndef BENCH_RTU_H
#define BENCH_RTU_H

#include <errno.h>
#include <sched.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <termios.h>
#include <time.h>

#define NS_PER_S 1000000000LL
#define NS_PER_MS 1000000LL

/* A character is 10 bits: start, eight data, no parity, one stop (8N1). */
#define BITS_PER_CHARACTER 10

/* Modbus over Serial Line V1.02, section 2.5.1.1: fixed above 19200 baud. */
#define FIXED_ABOVE 19200
#define FIXED_T15 750000LL
#define FIXED_T35 1750000LL

static inline int64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * NS_PER_S + t.tv_nsec;
}

static inline double us(int64_t ns) { return (double)ns / 1e3; }

static inline double seconds(int64_t ns) { return (double)ns / 1e9; }

/* How long n characters take on the wire. */
static inline int64_t characters_ns(long baudrate, int n) {
    return (int64_t)n * BITS_PER_CHARACTER * NS_PER_S / baudrate;
}

static inline int64_t t15_ns(long baudrate) {
    return baudrate > FIXED_ABOVE ? FIXED_T15 : characters_ns(baudrate, 3) / 2;
}

static inline int64_t t35_ns(long baudrate) {
    return baudrate > FIXED_ABOVE ? FIXED_T35 : characters_ns(baudrate, 7) / 2;
}

/* CRC-16/MODBUS: polynomial 0xA001, start 0xFFFF; sent low byte first. */
static inline uint16_t crc16(const uint8_t *bytes, int n) {
    uint16_t crc = 0xFFFF;
    for (int i = 0; i < n; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = crc & 1 ? (uint16_t)(crc >> 1 ^ 0xA001) : (uint16_t)(crc >> 1);
    }
    return crc;
}

static inline int seal(uint8_t *bytes, int n) {
    uint16_t crc = crc16(bytes, n);
    bytes[n] = (uint8_t)(crc & 0xFF);
    bytes[n + 1] = (uint8_t)(crc >> 8);
    return n + 2;
}

static inline bool sealed(const uint8_t *bytes, int n) {
    return n > 2 && crc16(bytes, n - 2) == (bytes[n - 2] | bytes[n - 1] << 8);
}

static inline long rate_of(speed_t speed) {
    switch (speed) {
    case B1200: return 1200;
    case B2400: return 2400;
    case B4800: return 4800;
    case B9600: return 9600;
    case B19200: return 19200;
    case B38400: return 38400;
    case B57600: return 57600;
    case B115200: return 115200;
    default: return 0;
    }
}

static inline speed_t speed_of(long rate) {
    static const speed_t speeds[] = {B1200, B2400, B4800, B9600, B19200, B38400, B57600, B115200};
    for (unsigned i = 0; i < sizeof speeds / sizeof *speeds; i++)
        if (rate_of(speeds[i]) == rate) return speeds[i];
    return B0;
}

/* Timers to the nanosecond, and ahead of everybody else where the system permits it. */
static inline bool become_prompt(int priority) {
    prctl(PR_SET_TIMERSLACK, 1UL);
    if (priority <= 0) return false;
    struct sched_param param = {.sched_priority = priority};
    return sched_setscheduler(0, SCHED_FIFO, &param) == 0;
}

/* A list of durations in ns: grows, sorts, tells its percentiles. */
struct series {
    int64_t *items;
    size_t n, room;
};

static inline void series_add(struct series *series, int64_t item) {
    if (series->n == series->room) {
        series->room = series->room ? series->room * 2 : 65536;
        series->items = realloc(series->items, series->room * sizeof *series->items);
        if (series->items == NULL) {
            perror("realloc");
            exit(1);
        }
    }
    series->items[series->n++] = item;
}

static inline int series_order(const void *a, const void *b) {
    int64_t left = *(const int64_t *)a, right = *(const int64_t *)b;
    return (left > right) - (left < right);
}

/* Print {"min":..,"p50":..,"p99":..,"max":..} in microseconds, nulls when empty; sorts the series. */
static inline void series_print(FILE *out, struct series *series) {
    if (series->n == 0) {
        fprintf(out, "{\"min\":null,\"p50\":null,\"p99\":null,\"max\":null}");
        return;
    }
    qsort(series->items, series->n, sizeof *series->items, series_order);
    const int64_t *items = series->items;
    size_t last = series->n - 1;
    fprintf(out, "{\"min\":%.1f,\"p50\":%.1f,\"p99\":%.1f,\"max\":%.1f}", us(items[0]), us(items[last / 2]),
            us(items[last * 99 / 100]), us(items[last]));
}

#endif
