/* SPDX-License-Identifier: Apache-2.0
 *
 * What a frame's payload says: the six messages, packed and looked into side by side.
 *
 * Packing writes into a buffer of TAXEL_LONGEST_PAYLOAD bytes and returns the length, 0 where
 * a field does not fit. Plain C without malloc. Knows nothing about frames or ports.
 * Source: protocol/SPEC.md.
 */
#ifndef TAXEL_MESSAGE_H
#define TAXEL_MESSAGE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TAXEL_PROTOCOL 1
#define TAXEL_EVERY_BOARD 255 /* as the board of what the host sends: whoever hears it */
#define TAXEL_LONGEST_ID 32   /* characters */
#define TAXEL_LONGEST_LIST 115 /* values of a data or current message */

enum taxel_kind {
  TAXEL_NO_MESSAGE = 0,
  TAXEL_HELLO = 1,
  TAXEL_DATA = 2,
  TAXEL_COMMAND = 3,
  TAXEL_HEARTBEAT = 4,
  TAXEL_ACKNOWLEDGE = 5,
  TAXEL_CURRENT = 6
};
enum taxel_ability { TAXEL_SENSORS = 1, TAXEL_CURRENTS = 2, TAXEL_MOTION = 4 };
enum taxel_order {
  TAXEL_IDENTIFY = 0,
  TAXEL_STOP = 1,
  TAXEL_ARM = 2,
  TAXEL_GRIP = 3,
  TAXEL_SET_RATE = 4
};
enum taxel_state {
  TAXEL_IDLE = 0,
  TAXEL_ARMED = 1,
  TAXEL_MOVING = 2,
  TAXEL_STOPPED = 3,
  TAXEL_FAULT = 4
};
enum taxel_result {
  TAXEL_DONE = 0,
  TAXEL_EXPIRED = 1,
  TAXEL_NOT_ARMED = 2,
  TAXEL_UNKNOWN = 3,
  TAXEL_BAD_ARGUMENT = 4,
  TAXEL_OLD = 5
};

/* The ten bytes that every message begins with. */
typedef struct {
  uint8_t board;
  uint32_t seq;  /* a board: timer ticks since boot; the host: its own count */
  uint32_t t_us; /* the sender's clock, microseconds */
} taxel_head;

typedef struct {
  uint8_t protocol;
  uint8_t firmware[3]; /* major, minor, patch */
  uint32_t boot_id;    /* another at each boot */
  uint16_t rate_hz;    /* at least 1 */
  uint8_t channels;    /* at most 115 */
  uint8_t adc_bits;    /* 8 to 16 */
  uint16_t reference_mv; /* volts of 2^bits counts; at least 1 */
  uint8_t abilities;
  uint8_t id_size;
  const char *id; /* printable ASCII, not ended by a zero; points into the payload when read */
} taxel_hello;

typedef struct {
  uint8_t order;
  uint16_t expires_ms, a, b, c;
} taxel_command;

typedef struct {
  uint8_t state;
  uint32_t dropped; /* scans taken and not sent since boot */
  uint32_t bad;     /* frames received and thrown away since boot */
} taxel_heartbeat;

typedef struct {
  uint32_t command_seq;
  uint32_t host_us; /* the command's t_us, as it came */
  uint8_t result;
} taxel_acknowledge;

/* Which commands of the host came before. All zero is its first state. */
typedef struct {
  uint32_t last;
  uint8_t heard;
} taxel_session;

/* True where a command's seq is not newer than the last command's, so that it is answered OLD.
 * A stop is never old. Nor is an identify, and the host's count begins anew with it: a host that
 * was started again begins with one, and counts from 0. */
uint8_t taxel_is_old(taxel_session *session, uint32_t seq, uint8_t order);

uint8_t taxel_pack_hello(uint8_t *payload, const taxel_head *head, const taxel_hello *hello);
uint8_t taxel_pack_data(uint8_t *payload, const taxel_head *head, const uint16_t *values,
                        uint8_t channels);
uint8_t taxel_pack_command(uint8_t *payload, const taxel_head *head, const taxel_command *command);
uint8_t taxel_pack_heartbeat(uint8_t *payload, const taxel_head *head,
                             const taxel_heartbeat *beat);
uint8_t taxel_pack_acknowledge(uint8_t *payload, const taxel_head *head,
                               const taxel_acknowledge *answer);
uint8_t taxel_pack_current(uint8_t *payload, const taxel_head *head, const int16_t *milliamps,
                           uint8_t motors);

/* Which message a payload is; TAXEL_NO_MESSAGE where its length or content fits none.
 * Only then may the others below be called, each for its own kind. */
uint8_t taxel_kind_of(const uint8_t *payload, uint8_t size);
void taxel_read_head(const uint8_t *payload, taxel_head *head);
void taxel_read_hello(const uint8_t *payload, taxel_hello *hello);
void taxel_read_command(const uint8_t *payload, taxel_command *command);
void taxel_read_heartbeat(const uint8_t *payload, taxel_heartbeat *beat);
void taxel_read_acknowledge(const uint8_t *payload, taxel_acknowledge *answer);
/* How many values a data or current message holds, and one of them (data unsigned). */
uint8_t taxel_list_size(uint8_t size);
uint16_t taxel_list_value(const uint8_t *payload, uint8_t index);

#ifdef __cplusplus
}
#endif
#endif
