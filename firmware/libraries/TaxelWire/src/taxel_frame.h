/* SPDX-License-Identifier: Apache-2.0
 *
 * Frames on the wire: COBS, a check over what is sent, a zero byte as the end.
 *
 *     frame = COBS(payload), check (3 bytes, none of them zero), 00
 *
 * Plain C without malloc, tested on the host against protocol/vectors.json. Knows nothing
 * about messages, ports or time. Source: protocol/SPEC.md, docs/decisions/0014.
 */
#ifndef TAXEL_FRAME_H
#define TAXEL_FRAME_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TAXEL_LONGEST_PAYLOAD 240 /* bytes */
#define TAXEL_CHECK 3             /* bytes of check, each with its highest bit set */
#define TAXEL_LONGEST_FRAME (TAXEL_LONGEST_PAYLOAD + 1 + TAXEL_CHECK) /* without the delimiter */
#define TAXEL_SHORTEST_FRAME (2 + TAXEL_CHECK)                        /* without the delimiter */

/* Frames that were received and thrown away, by reason; as in protocol/SPEC.md. */
typedef struct {
  uint32_t too_short;
  uint32_t too_long;
  uint32_t check;
  uint32_t cobs;
  uint32_t message; /* counted by whoever unpacks a payload */
} taxel_bad;

/* Cuts a stream of bytes into payloads. All zero is its first state. */
typedef struct {
  uint8_t bytes[TAXEL_LONGEST_FRAME]; /* the frame so far; its payload once one is complete */
  uint8_t used;
  uint8_t skipping; /* a frame grew too long: wait for its delimiter */
  taxel_bad bad;
} taxel_decoder;

/* One step of CRC-16, polynomial 0x1021, most significant bit first: `_crc_xmodem_update`. */
uint16_t taxel_crc(uint16_t crc, uint8_t byte);

/* Write a payload of 1 to 240 bytes as a frame with its delimiter into frame[245].
 * Returns the bytes written, 0 for a payload of another length. */
uint8_t taxel_frame(const uint8_t *payload, uint8_t size, uint8_t *frame);

/* Take in one byte. Returns the length of the payload that it completes, which then stands in
 * decoder->bytes until the next call; 0 where it completes none. */
uint8_t taxel_decode(taxel_decoder *decoder, uint8_t byte);

/* All frames thrown away. */
uint32_t taxel_bad_total(const taxel_bad *bad);

#ifdef __cplusplus
}
#endif
#endif
