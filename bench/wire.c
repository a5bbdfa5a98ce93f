#include "wire.h"

#include <string.h>
#include <unistd.h>

const char *const KIND_NAMES[] = {"ok", "crc", "truncated", "garbage", "late", "stale", "garbled", "echo"};

void wire_say(struct wire *wire, const struct talk *talk) {
    if (wire->n_talks == MAX_TALKS) {
        fprintf(stderr, "paced_line: more than %d answers are waiting\n", MAX_TALKS);
        exit(1);
    }
    wire->talks[wire->n_talks++] = *talk;
}

static int64_t byte_end(const struct talk *talk, int i) {
    return talk->start + characters_ns(talk->baudrate, i + 1);
}

bool wire_talking(const struct wire *wire, int64_t now) {
    for (int i = 0; i < wire->n_talks; i++)
        if (wire->talks[i].kind != KIND_ECHO && wire->talks[i].start <= now) return true;
    return false;
}

bool wire_surprising(const struct wire *wire, int64_t now) {
    for (int i = 0; i < wire->n_talks; i++) {
        const struct talk *talk = &wire->talks[i];
        if (talk->late && talk->sent == 0 && talk->start <= now) return true;
    }
    return wire->broken_by_late && now - wire->broken_at < LAST_LOOK;
}

void wire_trample(struct wire *wire, int64_t now) {
    for (int i = 0; i < wire->n_talks; i++) {
        struct talk *talk = &wire->talks[i];
        if (talk->kind != KIND_ECHO && talk->start <= now) talk->kind = KIND_GARBLED;
    }
}

void wire_overtake(struct wire *wire) {
    for (int i = 0; i < wire->n_talks; i++)
        if (wire->talks[i].kind == KIND_LATE) wire->talks[i].kind = KIND_STALE;
}

static int earliest(const struct wire *wire) {
    int first = -1;
    for (int i = 0; i < wire->n_talks; i++)
        if (first < 0 || byte_end(&wire->talks[i], wire->talks[i].sent) <
                             byte_end(&wire->talks[first], wire->talks[first].sent))
            first = i;
    return first;
}

/* The adapter hands over what it has at every tick of its latency timer, or when it is full. */
static int64_t adapter_due(const struct wire *wire) {
    int64_t ticks = (wire->adapter_since - wire->adapter_epoch) / wire->latency + 1;
    return wire->adapter_epoch + ticks * wire->latency;
}

int64_t wire_due(const struct wire *wire) {
    int first = earliest(wire);
    int64_t due = first < 0 ? INT64_MAX : byte_end(&wire->talks[first], wire->talks[first].sent);
    if (wire->n_adapter > 0) {
        int64_t tick = adapter_due(wire);
        if (tick < due) due = tick;
    }
    return due;
}

static void hand_over(struct wire *wire, const uint8_t *bytes, int n) {
    if (write(wire->master, bytes, (size_t)n) != n) perror("paced_line: write");
}

static void hand_over_pieces(struct wire *wire, int64_t now) {
    if (wire->n_adapter == 0) return;
    if (wire->n_adapter < ADAPTER_ROOM && adapter_due(wire) > now) return;
    hand_over(wire, wire->adapter, wire->n_adapter);
    wire->n_adapter = 0;
}

static void end_talk(struct wire *wire, int index) {
    struct talk *talk = &wire->talks[index];
    struct judge *judge = wire->judge;
    if (talk->kind != KIND_ECHO) {
        judge->garbled += talk->kind == KIND_GARBLED;
        if (talk->kind == KIND_OK || talk->kind == KIND_LATE || talk->kind == KIND_STALE) {
            if (judge->answered++ == 0) judge->first_answer = wire->quiet_since;
            judge->last_answer = wire->quiet_since;
        }
    }
    if (wire->log != NULL && talk->carries_value)
        fprintf(wire->log, "%d %08x %lld %lld %s\n", talk->slave, talk->value, (long long)talk->requested,
                (long long)wire->quiet_since, KIND_NAMES[talk->kind]);
    wire->talks[index] = wire->talks[--wire->n_talks];
}

/* Two talkers at once, or a talker on top of the master's frame, destroy each other. */
static void begin_talk(struct wire *wire, struct talk *talk) {
    for (int i = 0; i < wire->n_talks; i++) {
        struct talk *other = &wire->talks[i];
        if (other == talk || other->kind == KIND_ECHO || other->start > talk->start) continue;
        other->kind = talk->kind = KIND_GARBLED;
    }
    if (wire->sending_from <= talk->start && talk->start < wire->sending_to) {
        wire->request_hit = true;
        talk->kind = KIND_GARBLED;
    }
}

void wire_deliver(struct wire *wire) {
    for (int index; (index = earliest(wire)) >= 0;) {
        struct talk *talk = &wire->talks[index];
        int64_t due = byte_end(talk, talk->sent), now = now_ns();
        if (due > now) break;
        if (talk->kind != KIND_ECHO) {
            if (talk->sent == 0) begin_talk(wire, talk);
            int64_t begun = due - characters_ns(talk->baudrate, 1);
            if (wire->quiet_since + t35_ns(talk->baudrate) <= begun) {
                wire->broken_at = now;
                wire->broken_by_late = talk->late;
            }
        }
        uint8_t byte = talk->bytes[talk->sent++];
        if (talk->kind == KIND_GARBLED) byte ^= 0xA5;
        series_add(&wire->judge->pace, now - due);
        if (wire->latency == 0) {
            hand_over(wire, &byte, 1);
        } else {
            hand_over_pieces(wire, due - 1); /* what a tick before this byte would have taken */
            if (wire->n_adapter == 0) wire->adapter_since = due;
            wire->adapter[wire->n_adapter++] = byte;
        }
        /* Without an adapter the byte ends when it is really readable: the master cannot hear it earlier. */
        int64_t ended = wire->latency == 0 ? now : due;
        if (talk->kind != KIND_ECHO && ended > wire->quiet_since) wire->quiet_since = ended;
        if (talk->sent == talk->n) end_talk(wire, index);
    }
    if (wire->latency > 0) hand_over_pieces(wire, now_ns());
}
