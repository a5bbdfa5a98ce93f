/* A strict RS485 line full of LFS10 sensors on a pseudo terminal, in true time, and its judge.
 *
 * Independent of the daemon and of its simulator. A request is heard only if at least t3.5 of silence lay
 * before it, no pause above t1.5 inside it, its check is right and the port runs at the sensors' rate. The
 * time of a request is when its bytes become readable here; it is then on the wire for n characters. Every
 * answer carries a value sent only once in the run, and is logged: slave, bits, begin of its request, end of its
 * last byte (CLOCK_MONOTONIC, ns), kind. SIGUSR1 prints the counts as one JSON line and begins a new
 * window; SIGTERM and SIGINT print them and end.
 */
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

#include "options.h"
#include "wire.h"

enum { FRAME_ROOM = 256, READ_REQUEST = 8, FIRST_VALUE = 0x3F800000 /* 1.0 */, PRIORITY = 50 };

/* Waking up costs that long on a small machine, so the last of each wait is spent awake. */
#define AWAKE_BEFORE (70 * 1000LL)
#define AWAKE_AROUND (150 * 1000LL)

struct frame { /* the one the master is sending */
    uint8_t bytes[FRAME_ROOM];
    int n;
    int64_t begun, ended;
    bool spoilt;
};

struct line {
    struct options options;
    struct wire wire;
    struct judge judge;
    struct frame frame;
    int64_t opened;
    int64_t busy_until[ANY_ID]; /* a sensor answers in order */
    uint32_t values;            /* sent so far */
    uint64_t chance;
};

static volatile sig_atomic_t ending, asked;

static void on_signal(int number) {
    if (number == SIGUSR1) asked = 1;
    else ending = 1;
}

/* xorshift64*: the same faults in every run with the same seed. */
static double chance(struct line *line) {
    line->chance ^= line->chance >> 12;
    line->chance ^= line->chance << 25;
    line->chance ^= line->chance >> 27;
    return (double)((line->chance * 0x2545F4914F6CDD1DULL) >> 11) / 9007199254740992.0;
}

/* Half of the noise breaks the check, a quarter cuts the answer short, a quarter replaces it. */
static void spoil(struct line *line, struct talk *talk) {
    double dice = chance(line) * 100.0;
    if (dice >= line->options.noise) return;
    if (dice < line->options.noise / 2) {
        talk->kind = KIND_CRC;
        talk->bytes[(int)(chance(line) * talk->n)] ^= (uint8_t)(1 << (int)(chance(line) * 8));
        line->judge.crc++;
    } else if (dice < line->options.noise * 3 / 4) {
        talk->kind = KIND_TRUNCATED;
        talk->n = 1 + (int)(chance(line) * (talk->n - 1));
        line->judge.truncated++;
    } else {
        talk->kind = KIND_GARBAGE;
        talk->n = 1 + (int)(chance(line) * 12);
        for (int i = 0; i < talk->n; i++) talk->bytes[i] = (uint8_t)(chance(line) * 256);
        line->judge.garbage++;
    }
}

/* LFS10: 0x0001-0x0002 wind speed, 0x0004 rate code, 0x0005 slave id; writing is refused here. */
static void answer(struct line *line, const uint8_t *request, struct talk *talk) {
    int address = request[2] << 8 | request[3], count = request[4] << 8 | request[5];
    uint16_t registers[6] = {0, 0, 0, 0, line->options.baudrate == 19200 ? 2 : 1, (uint16_t)talk->slave};
    bool value = address == 1 && count == 2, setting = address >= 4 && count >= 1 && address + count <= 6;
    talk->bytes[0] = request[0];
    if (request[1] != 3 || !(value || setting)) {
        talk->bytes[1] = request[1] | 0x80;
        talk->bytes[2] = 2; /* illegal register address */
        talk->n = seal(talk->bytes, 3);
        return;
    }
    if (value) {
        talk->carries_value = true;
        talk->value = FIRST_VALUE + line->values++;
        registers[1] = (uint16_t)(talk->value >> 16);
        registers[2] = (uint16_t)(talk->value & 0xFFFF);
    }
    talk->bytes[1] = 3;
    talk->bytes[2] = (uint8_t)(2 * count);
    for (int i = 0; i < count; i++) {
        talk->bytes[3 + 2 * i] = (uint8_t)(registers[address + i] >> 8);
        talk->bytes[4 + 2 * i] = (uint8_t)(registers[address + i] & 0xFF);
    }
    talk->n = seal(talk->bytes, 3 + 2 * count);
}

/* A whole frame in time: its sensor answers after t3.5 and its turnaround, and after what it still owes. */
static void hear(struct line *line, const struct frame *frame) {
    int slave = frame->bytes[0];
    const struct options *options = &line->options;
    line->judge.heard++;
    bool died = options->dead[slave] && frame->begun - line->opened >= options->die_after;
    if (slave < 1 || slave > options->sensors || died) {
        line->judge.unanswered++;
        return;
    }
    struct talk talk = {.slave = slave, .baudrate = options->baudrate, .requested = frame->begun, .kind = KIND_OK};
    answer(line, frame->bytes, &talk);
    talk.start = frame->ended + t35_ns(options->baudrate) + options->turnaround;
    if (options->late > 0 && chance(line) * 100.0 < options->late) {
        talk.kind = KIND_LATE;
        talk.late = true;
        talk.start += options->late_by;
        line->judge.late++;
    } else {
        spoil(line, &talk);
    }
    if (talk.start < line->busy_until[slave]) talk.start = line->busy_until[slave];
    line->busy_until[slave] =
        talk.start + characters_ns(options->baudrate, talk.n) + t35_ns(options->baudrate) + options->turnaround;
    wire_say(&line->wire, &talk);
}

static int64_t frame_due(const struct line *line) {
    return line->frame.n == 0 ? INT64_MAX : line->frame.ended + t35_ns(line->options.baudrate);
}

/* t3.5 of silence ends a frame. */
static void end_frame(struct line *line, int64_t now) {
    struct frame *frame = &line->frame;
    if (now < frame_due(line)) return;
    struct termios settings;
    if (line->wire.request_hit) {
        line->judge.collided++;
    } else if (!frame->spoilt) {
        if (tcgetattr(line->wire.master, &settings) == 0 && rate_of(cfgetispeed(&settings)) != line->options.baudrate)
            line->judge.wrong_rate++;
        else if (frame->n != READ_REQUEST || !sealed(frame->bytes, frame->n))
            line->judge.bad_frames++;
        else
            hear(line, frame);
    }
    frame->n = 0;
    line->wire.request_hit = false;
}

static void begin_frame(struct line *line, int64_t now) {
    struct wire *wire = &line->wire;
    struct judge *judge = &line->judge;
    bool talking = wire_talking(wire, now);
    int64_t gap = talking ? 0 : now - wire->quiet_since;
    line->frame = (struct frame){.begun = now, .ended = now};
    judge->requests++;
    if (wire->quiet_since > 0) series_add(&judge->gaps, gap);
    if (gap < t35_ns(line->options.baudrate)) {
        line->frame.spoilt = true;
        if (wire_surprising(wire, now)) judge->last_look++;
        else judge->too_early++;
    }
    if (talking) wire_trample(wire, now);
    wire_overtake(wire);
}

static void hear_bytes(struct line *line, const uint8_t *bytes, int n, int64_t now) {
    struct wire *wire = &line->wire;
    struct frame *frame = &line->frame;
    end_frame(line, now);
    if (frame->n == 0) {
        begin_frame(line, now);
    } else if (frame->n >= READ_REQUEST) { /* a second request is a continuation of the first */
        line->judge.requests++;
        line->judge.too_early++;
        frame->spoilt = true;
    } else if (now > frame->ended + t15_ns(line->options.baudrate)) {
        if (!frame->spoilt) line->judge.pauses++;
        frame->spoilt = true;
    }
    for (int i = 0; i < n && frame->n < FRAME_ROOM; i++) frame->bytes[frame->n++] = bytes[i];
    int64_t from = now > frame->ended ? now : frame->ended;
    frame->ended = from + characters_ns(line->options.baudrate, n);
    wire->sending_from = frame->begun;
    wire->sending_to = frame->ended;
    if (frame->ended > wire->quiet_since) wire->quiet_since = frame->ended;
    for (int i = 0; line->options.echo && i < n; i += 64) {
        struct talk echo = {.kind = KIND_ECHO, .baudrate = line->options.baudrate, .start = from};
        echo.n = n - i < 64 ? n - i : 64;
        memcpy(echo.bytes, bytes + i, (size_t)echo.n);
        echo.start += characters_ns(line->options.baudrate, i);
        wire_say(wire, &echo);
    }
}

static void print_counts(struct line *line) {
    int64_t now = now_ns();
    if (line->wire.log != NULL) fflush(line->wire.log);
    judge_print(stdout, &line->judge, now, t35_ns(line->options.baudrate), line->options.fifo);
    judge_begin(&line->judge, now_ns());
}

/* How long to sleep at most: not at all just before something is due, nor around the moment that parts
 * a request in time from one too early; INT64_MAX for ever. */
static int64_t sleep_ns(const struct line *line, int64_t now) {
    int64_t due = wire_due(&line->wire), frame = frame_due(line);
    int64_t verdict = line->wire.quiet_since + t35_ns(line->options.baudrate);
    if (frame < due) due = frame;
    if (due != INT64_MAX) due -= AWAKE_BEFORE;
    if (now < verdict + AWAKE_AROUND && verdict - AWAKE_AROUND < due) due = verdict - AWAKE_AROUND;
    if (due == INT64_MAX) return due;
    return due > now ? due - now : 0;
}

/* Signals come only while we wait, so that no count is torn. */
static void serve(struct line *line, const sigset_t *waiting) {
    uint8_t bytes[FRAME_ROOM];
    while (!ending) {
        int64_t wait = sleep_ns(line, now_ns());
        struct timespec timeout = {.tv_sec = wait / NS_PER_S, .tv_nsec = wait % NS_PER_S};
        struct pollfd end = {.fd = line->wire.master, .events = POLLIN};
        int ready = ppoll(&end, 1, wait == INT64_MAX ? NULL : &timeout, waiting);
        if (ready > 0 && end.revents & POLLIN) {
            int n = (int)read(line->wire.master, bytes, sizeof bytes);
            int64_t now = now_ns();
            if (n > 0) hear_bytes(line, bytes, n, now);
        }
        wire_deliver(&line->wire);
        end_frame(line, now_ns());
        if (asked) {
            asked = 0;
            print_counts(line);
        }
    }
    print_counts(line);
}

/* Our own hold on the other end keeps the pair alive between two masters. */
static int open_pair(struct line *line) {
    int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (master < 0 || grantpt(master) < 0 || unlockpt(master) < 0) {
        perror("paced_line: pseudo terminal");
        exit(1);
    }
    const char *path = ptsname(master);
    struct termios raw;
    int hold = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (hold < 0 || tcgetattr(hold, &raw) < 0) {
        perror(path);
        exit(1);
    }
    cfmakeraw(&raw);
    tcsetattr(hold, TCSANOW, &raw);
    if (line->options.link != NULL) {
        unlink(line->options.link);
        if (symlink(path, line->options.link) < 0) {
            perror(line->options.link);
            exit(1);
        }
    }
    printf("{\"port\":\"%s\"}\n", line->options.link != NULL ? line->options.link : path);
    fflush(stdout);
    return master;
}

int main(int argc, char **argv) {
    static struct line line;
    read_options(&line.options, argc, argv);
    line.wire.latency = line.options.latency;
    line.chance = line.options.seed * 2 + 1;
    if (line.options.log != NULL) {
        line.wire.log = fopen(line.options.log, "w");
        if (line.wire.log == NULL) {
            perror(line.options.log);
            return 1;
        }
        setvbuf(line.wire.log, NULL, _IOFBF, 1 << 20);
    }
    sigset_t blocked, waiting;
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGTERM);
    sigaddset(&blocked, SIGINT);
    sigaddset(&blocked, SIGUSR1);
    sigprocmask(SIG_BLOCK, &blocked, &waiting);
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGUSR1, &action, NULL);
    line.wire.judge = &line.judge;
    line.wire.master = open_pair(&line);
    line.options.fifo = become_prompt(line.options.fifo ? PRIORITY : 0);
    line.opened = line.wire.adapter_epoch = now_ns();
    judge_begin(&line.judge, line.opened);
    serve(&line, &waiting);
    if (line.options.link != NULL) unlink(line.options.link);
    return 0;
}
