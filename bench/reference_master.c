/* What a plain C master reaches on a line: the same sensors in turn, true gaps, as fast as the wire allows.
 *
 * Plain termios, one write() a request, poll() and read() until the expected length, a fixed time-out. With
 * --mqtt HOST:PORT (if built with libmosquitto) each poll is published with QoS 1, for the comparison of
 * CPU time. Prints one JSON line at its end (SIGTERM, SIGINT or --seconds).
 */
#include <fcntl.h>
#include <getopt.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include "rtu.h"
#ifdef HAVE_MOSQUITTO
#include <mosquitto.h>
#endif

enum { REQUEST = 8, ANSWER = 9, EXCEPTION = 5, ROOM = 256, PRIORITY = 20 };

/* Silence inside an answer after which it is given up: adapters deliver in pieces. */
#define BROKEN_AFTER (20 * NS_PER_MS)

struct master {
    const char *port, *mqtt;
    long baudrate;
    int first, last;
    double seconds;
    int64_t timeout;
    bool fifo;
    int fd;
    int64_t quiet_since;
    long polls, good, timeouts, broken;
    struct series gaps;
#ifdef HAVE_MOSQUITTO
    struct mosquitto *client;
#endif
};

static volatile sig_atomic_t ending;

static void on_signal(int number) {
    (void)number;
    ending = 1;
}

static void open_port(struct master *master) {
    struct termios settings;
    master->fd = open(master->port, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (master->fd < 0 || tcgetattr(master->fd, &settings) < 0) {
        perror(master->port);
        exit(1);
    }
    cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    settings.c_cc[VMIN] = 0;
    settings.c_cc[VTIME] = 0;
    cfsetspeed(&settings, speed_of(master->baudrate));
    if (tcsetattr(master->fd, TCSANOW, &settings) < 0) {
        perror(master->port);
        exit(1);
    }
    tcflush(master->fd, TCIOFLUSH);
    master->quiet_since = now_ns();
}

/* Wait until the line has been silent for t3.5; whatever is heard begins the silence anew. */
static void await_silence(struct master *master) {
    uint8_t noise[ROOM];
    while (!ending) {
        int64_t wait = master->quiet_since + t35_ns(master->baudrate) - now_ns();
        if (wait > 0) {
            struct timespec timeout = {.tv_sec = wait / NS_PER_S, .tv_nsec = wait % NS_PER_S};
            struct pollfd end = {.fd = master->fd, .events = POLLIN};
            ppoll(&end, 1, &timeout, NULL);
        }
        int waiting = 0;
        ioctl(master->fd, FIONREAD, &waiting);
        if (waiting > 0 && read(master->fd, noise, sizeof noise) > 0) master->quiet_since = now_ns();
        else if (wait <= 0) return;
    }
}

/* Read until the answer is whole, or begins not at all in the time-out, or breaks off. */
static int listen_for_answer(struct master *master, int64_t sent, uint8_t *answer) {
    int n = 0, expected = ANSWER;
    int64_t deadline = sent + master->timeout;
    while (n < expected && !ending) {
        int64_t wait = deadline - now_ns();
        if (wait <= 0) break;
        struct timespec timeout = {.tv_sec = wait / NS_PER_S, .tv_nsec = wait % NS_PER_S};
        struct pollfd end = {.fd = master->fd, .events = POLLIN};
        if (ppoll(&end, 1, &timeout, NULL) <= 0) continue;
        int more = (int)read(master->fd, answer + n, (size_t)(ROOM - n));
        if (more <= 0) exit(1);
        master->quiet_since = now_ns();
        deadline = master->quiet_since + t35_ns(master->baudrate) + BROKEN_AFTER;
        n += more;
        if (n >= 2 && answer[1] & 0x80) expected = EXCEPTION;
    }
    return n;
}

static void publish(struct master *master, int slave, const uint8_t *answer, double rtt_ms) {
#ifdef HAVE_MOSQUITTO
    if (master->client == NULL) return;
    char topic[64], payload[400], when[40];
    struct timespec wall;
    clock_gettime(CLOCK_REALTIME, &wall);
    struct tm utc;
    gmtime_r(&wall.tv_sec, &utc);
    strftime(when, sizeof when, "%Y-%m-%dT%H:%M:%S", &utc);
    uint32_t bits = (uint32_t)answer[3] << 24 | (uint32_t)answer[4] << 16 | (uint32_t)answer[5] << 8 | answer[6];
    float value;
    memcpy(&value, &bits, sizeof value);
    long ms = wall.tv_nsec / 1000000;
    snprintf(topic, sizeof topic, "reference/line0/device/slave-%d/telemetry", slave);
    int n = snprintf(payload, sizeof payload,
                     "{\"v\":1,\"line\":\"line0\",\"device\":\"slave-%d\",\"boot\":\"c\",\"seq\":%ld,\"ts\":%lld%03ld,"
                     "\"time\":\"%s.%03ldZ\",\"clock\":\"synced\",\"wind_speed\":%.9g,\"unit\":\"m/s\","
                     "\"quality\":\"good\",\"error\":null,\"rtt_ms\":%.1f}",
                     slave, master->good, (long long)wall.tv_sec, ms, when, ms, (double)value, rtt_ms);
    mosquitto_publish(master->client, NULL, topic, n, payload, 1, false);
#else
    (void)master, (void)slave, (void)answer, (void)rtt_ms;
#endif
}

static void connect_broker(struct master *master) {
    if (master->mqtt == NULL) return;
#ifdef HAVE_MOSQUITTO
    char host[128];
    int port;
    if (sscanf(master->mqtt, "%127[^:]:%d", host, &port) != 2) {
        fprintf(stderr, "reference_master: --mqtt wants HOST:PORT\n");
        exit(2);
    }
    mosquitto_lib_init();
    master->client = mosquitto_new(NULL, true, NULL);
    int failed = mosquitto_connect(master->client, host, port, 20);
    if (!failed) failed = mosquitto_loop_start(master->client);
    if (failed) {
        fprintf(stderr, "reference_master: %s: %s\n", master->mqtt, mosquitto_strerror(failed));
        exit(1);
    }
#else
    fprintf(stderr, "reference_master: built without libmosquitto\n");
    exit(2);
#endif
}

static void poll_once(struct master *master, int slave) {
    uint8_t request[REQUEST] = {(uint8_t)slave, 3, 0, 1, 0, 2}, answer[ROOM];
    seal(request, REQUEST - 2);
    await_silence(master);
    if (ending) return;
    int64_t begun = now_ns();
    series_add(&master->gaps, begun - master->quiet_since);
    if (write(master->fd, request, sizeof request) != REQUEST) {
        perror(master->port);
        exit(1);
    }
    int64_t sent = now_ns() + characters_ns(master->baudrate, REQUEST);
    master->quiet_since = sent;
    int n = listen_for_answer(master, sent, answer);
    if (ending) return;
    master->polls++;
    if (n == 0) {
        master->timeouts++;
    } else if (n != ANSWER || answer[0] != slave || answer[1] != 3 || answer[2] != 4 || !sealed(answer, n)) {
        master->broken++;
    } else {
        master->good++;
        publish(master, slave, answer, us(now_ns() - begun) / 1e3);
    }
}

static void read_options(struct master *master, int argc, char **argv) {
    static const struct option known[] = {
        {"baudrate", required_argument, NULL, 'b'}, {"ids", required_argument, NULL, 'i'},
        {"seconds", required_argument, NULL, 's'},  {"timeout", required_argument, NULL, 't'},
        {"mqtt", required_argument, NULL, 'm'},     {"no-fifo", no_argument, NULL, 'F'},
        {NULL, 0, NULL, 0}};
    *master = (struct master){.baudrate = 9600, .first = 1, .last = 32, .timeout = 200 * NS_PER_MS, .fifo = true};
    for (int option; (option = getopt_long(argc, argv, "", known, NULL)) != -1;) {
        switch (option) {
        case 'b': master->baudrate = atol(optarg); break;
        case 'i':
            if (sscanf(optarg, "%d-%d", &master->first, &master->last) != 2) master->last = 0;
            break;
        case 's': master->seconds = atof(optarg); break;
        case 't': master->timeout = (int64_t)(atof(optarg) * NS_PER_MS); break;
        case 'm': master->mqtt = optarg; break;
        case 'F': master->fifo = false; break;
        default: exit(2);
        }
    }
    if (optind != argc - 1 || speed_of(master->baudrate) == B0 || master->first < 1 || master->last < master->first ||
        master->last > 255) {
        fprintf(stderr, "usage: reference_master [--baudrate 9600] [--ids 1-32] [--seconds N] [--timeout MS] "
                        "[--mqtt HOST:PORT] [--no-fifo] PORT\n");
        exit(2);
    }
    master->port = argv[optind];
}

int main(int argc, char **argv) {
    struct master master;
    read_options(&master, argc, argv);
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    connect_broker(&master);
    open_port(&master);
    master.fifo = become_prompt(master.fifo ? PRIORITY : 0);
    int64_t begun = now_ns();
    for (int slave = master.first; !ending; slave = slave < master.last ? slave + 1 : master.first) {
        if (master.seconds > 0 && seconds(now_ns() - begun) >= master.seconds) break;
        poll_once(&master, slave);
    }
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    double cpu = (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
                 (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) / 1e6;
    printf("{\"polls\":%ld,\"good\":%ld,\"timeouts\":%ld,\"broken\":%ld,\"elapsed_s\":%.6f,\"cpu_s\":%.6f,\"fifo\":%s,"
           "\"gap_us\":",
           master.polls, master.good, master.timeouts, master.broken, seconds(now_ns() - begun), cpu,
           master.fifo ? "true" : "false");
    series_print(stdout, &master.gaps);
    printf("}\n");
    return 0;
}
