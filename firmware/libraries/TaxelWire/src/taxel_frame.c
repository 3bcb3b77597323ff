/* SPDX-License-Identifier: Apache-2.0 */
#include "taxel_frame.h"

#ifdef __AVR__
#include <util/crc16.h>

/* The same in 17 instructions; the shifts below would take over a hundred there. */
uint16_t taxel_crc(uint16_t crc, uint8_t byte) { return _crc_xmodem_update(crc, byte); }
#else
uint16_t taxel_crc(uint16_t crc, uint8_t byte) {
  uint8_t x = (uint8_t)((crc >> 8) ^ byte);
  x ^= (uint8_t)(x >> 4);
  return (uint16_t)((crc << 8) ^ ((uint16_t)x << 12) ^ ((uint16_t)x << 5) ^ x);
}
#endif

static uint16_t crc_of(const uint8_t *bytes, uint8_t size) {
  uint16_t crc = 0xFFFF;
  for (uint8_t i = 0; i < size; i++) crc = taxel_crc(crc, bytes[i]);
  return crc;
}

static void put_check(uint16_t crc, uint8_t *check) {
  check[0] = (uint8_t)(0x80 | (crc >> 9));
  check[1] = (uint8_t)(0x80 | ((crc >> 2) & 0x7F));
  check[2] = (uint8_t)(0x80 | ((crc & 3) << 5));
}

uint8_t taxel_frame(const uint8_t *payload, uint8_t size, uint8_t *frame) {
  if (size == 0 || size > TAXEL_LONGEST_PAYLOAD) return 0;
  /* A group never reaches COBS's 254 bytes: a payload has 240 at most. */
  uint8_t code_at = 0;
  uint8_t used = 1;
  for (uint8_t i = 0; i < size; i++) {
    if (payload[i] == 0) {
      frame[code_at] = (uint8_t)(used - code_at);
      code_at = used++;
    } else {
      frame[used++] = payload[i];
    }
  }
  frame[code_at] = (uint8_t)(used - code_at);
  put_check(crc_of(frame, used), frame + used);
  used = (uint8_t)(used + TAXEL_CHECK);
  frame[used++] = 0;
  return used;
}

/* Decode in place: what is written never overtakes what is read. Returns 0 for what is no COBS. */
static uint8_t cobs_decode(uint8_t *bytes, uint8_t size) {
  uint8_t read = 0;
  uint8_t written = 0;
  while (read < size) {
    uint8_t code = bytes[read++];
    if (code - 1 > size - read) return 0;
    for (uint8_t i = 1; i < code; i++) bytes[written++] = bytes[read++];
    if (read < size) bytes[written++] = 0;
  }
  return written;
}

static uint8_t ended(taxel_decoder *decoder) {
  uint8_t size = decoder->used;
  decoder->used = 0;
  if (size == 0) return 0; /* nothing between two zeros is no frame */
  if (size < TAXEL_SHORTEST_FRAME) {
    decoder->bad.too_short++;
    return 0;
  }
  uint8_t check[TAXEL_CHECK];
  size = (uint8_t)(size - TAXEL_CHECK);
  put_check(crc_of(decoder->bytes, size), check);
  for (uint8_t i = 0; i < TAXEL_CHECK; i++) {
    if (decoder->bytes[size + i] != check[i]) {
      decoder->bad.check++;
      return 0;
    }
  }
  size = cobs_decode(decoder->bytes, size);
  if (size == 0) decoder->bad.cobs++;
  return size;
}

uint8_t taxel_decode(taxel_decoder *decoder, uint8_t byte) {
  if (byte == 0) {
    if (!decoder->skipping) return ended(decoder);
    decoder->skipping = 0;
    return 0;
  }
  if (decoder->skipping) return 0;
  if (decoder->used == TAXEL_LONGEST_FRAME) {
    decoder->bad.too_long++;
    decoder->skipping = 1;
    decoder->used = 0;
    return 0;
  }
  decoder->bytes[decoder->used++] = byte;
  return 0;
}

uint32_t taxel_bad_total(const taxel_bad *bad) {
  return bad->too_short + bad->too_long + bad->check + bad->cobs + bad->message;
}
