#include "options.h"

#include <getopt.h>

static void read_ids(const char *text, bool *ids) {
    for (char *end; *text != '\0'; text = *end == ',' ? end + 1 : end) {
        long id = strtol(text, &end, 10);
        if (end == text || id < 1 || id > 255) {
            fprintf(stderr, "paced_line: --dead wants ids of 1 to 255, like 5,9\n");
            exit(2);
        }
        ids[id] = true;
    }
}

void read_options(struct options *options, int argc, char **argv) {
    enum { DEAD = 'd', DIE = 'D', LATE_BY = 'L', NO_FIFO = 'F' };
    static const struct option known[] = {
        {"sensors", required_argument, NULL, 'n'},   {"baudrate", required_argument, NULL, 'b'},
        {"turnaround", required_argument, NULL, 't'}, {"link", required_argument, NULL, 'l'},
        {"log", required_argument, NULL, 'o'},       {"dead", required_argument, NULL, DEAD},
        {"die-after", required_argument, NULL, DIE}, {"noise", required_argument, NULL, 'x'},
        {"late", required_argument, NULL, 'y'},      {"late-by", required_argument, NULL, LATE_BY},
        {"adapter", required_argument, NULL, 'a'},   {"echo", no_argument, NULL, 'e'},
        {"seed", required_argument, NULL, 's'},      {"no-fifo", no_argument, NULL, NO_FIFO},
        {NULL, 0, NULL, 0}};
    *options = (struct options){.sensors = 32, .baudrate = 9600, .turnaround = 5 * NS_PER_MS, .fifo = true};
    options->late_by = 550 * NS_PER_MS;
    options->seed = 5;
    for (int option; (option = getopt_long(argc, argv, "", known, NULL)) != -1;) {
        switch (option) {
        case 'n': options->sensors = atoi(optarg); break;
        case 'b': options->baudrate = atol(optarg); break;
        case 't': options->turnaround = (int64_t)(atof(optarg) * NS_PER_MS); break;
        case 'l': options->link = optarg; break;
        case 'o': options->log = optarg; break;
        case DEAD: read_ids(optarg, options->dead); break;
        case DIE: options->die_after = (int64_t)(atof(optarg) * NS_PER_S); break;
        case 'x': options->noise = atof(optarg); break;
        case 'y': options->late = atof(optarg); break;
        case LATE_BY: options->late_by = (int64_t)(atof(optarg) * NS_PER_MS); break;
        case 'a': options->latency = (int64_t)(atof(optarg) * NS_PER_MS); break;
        case 'e': options->echo = true; break;
        case 's': options->seed = strtoull(optarg, NULL, 10); break;
        case NO_FIFO: options->fifo = false; break;
        default: exit(2);
        }
    }
    if (options->sensors < 0 || options->sensors > 255 || speed_of(options->baudrate) == B0) {
        fprintf(stderr, "paced_line: --sensors is 0 to 255, --baudrate 1200 to 115200 (ms: --turnaround, "
                        "--late-by, --adapter; s: --die-after; %%: --noise, --late)\n");
        exit(2);
    }
}
