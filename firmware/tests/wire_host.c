/* SPDX-License-Identifier: Apache-2.0
 *
 * TaxelWire on the host, for tests: one request a line on stdin, one answer a line on stdout.
 *
 *   crc HEX                 the CRC of these bytes, decimal
 *   frame HEX               the frame of this payload, or "none"
 *   repack HEX              the payload read into a message and packed again, or "none"
 *   feed HEX                payloads of these bytes joined by commas, then the counts of bad frames
 *                           short long check cobs message, then the bytes that still wait
 *   fresh                   a new decoder
 */
#include <stdio.h>
#include <string.h>

#include "TaxelWire.h"

static uint8_t bytes[1 << 16];

static size_t from_hex(const char *text) {
  size_t size = 0;
  unsigned value;
  while (sscanf(text + 2 * size, "%2x", &value) == 1) bytes[size++] = (uint8_t)value;
  return size;
}

static void print_hex(const uint8_t *from, size_t size) {
  for (size_t i = 0; i < size; i++) printf("%02x", from[i]);
}

static uint8_t repack(const uint8_t *payload, uint8_t size, uint8_t *again) {
  taxel_head head;
  uint16_t values[TAXEL_LONGEST_LIST];
  int16_t milliamps[TAXEL_LONGEST_LIST];
  taxel_hello hello;
  taxel_command command;
  taxel_heartbeat beat;
  taxel_acknowledge answer;
  uint8_t kind = taxel_kind_of(payload, size);
  if (!kind) return 0;
  taxel_read_head(payload, &head);
  uint8_t count = taxel_list_size(size);
  switch (kind) {
    case TAXEL_HELLO:
      taxel_read_hello(payload, &hello);
      return taxel_pack_hello(again, &head, &hello);
    case TAXEL_DATA:
      for (uint8_t i = 0; i < count; i++) values[i] = taxel_list_value(payload, i);
      return taxel_pack_data(again, &head, values, count);
    case TAXEL_COMMAND:
      taxel_read_command(payload, &command);
      return taxel_pack_command(again, &head, &command);
    case TAXEL_HEARTBEAT:
      taxel_read_heartbeat(payload, &beat);
      return taxel_pack_heartbeat(again, &head, &beat);
    case TAXEL_ACKNOWLEDGE:
      taxel_read_acknowledge(payload, &answer);
      return taxel_pack_acknowledge(again, &head, &answer);
    default:
      for (uint8_t i = 0; i < count; i++) milliamps[i] = (int16_t)taxel_list_value(payload, i);
      return taxel_pack_current(again, &head, milliamps, count);
  }
}

int main(void) {
  static char line[1 << 18];
  static taxel_decoder decoder;
  uint8_t frame[TAXEL_LONGEST_FRAME + 1], again[TAXEL_LONGEST_PAYLOAD];
  while (fgets(line, sizeof line, stdin)) {
    char *hex = strchr(line, ' ');
    size_t size = hex ? from_hex(hex + 1) : 0;
    if (!strncmp(line, "crc", 3)) {
      uint16_t crc = 0xFFFF;
      for (size_t i = 0; i < size; i++) crc = taxel_crc(crc, bytes[i]);
      printf("%u", crc);
    } else if (!strncmp(line, "frame", 5)) {
      uint8_t length = size > 255 ? 0 : taxel_frame(bytes, (uint8_t)size, frame);
      if (length) print_hex(frame, length);
      else printf("none");
    } else if (!strncmp(line, "repack", 6)) {
      uint8_t length = size > 240 ? 0 : repack(bytes, (uint8_t)size, again);
      if (length) print_hex(again, length);
      else printf("none");
    } else if (!strncmp(line, "feed", 4)) {
      for (size_t i = 0; i < size; i++) {
        uint8_t length = taxel_decode(&decoder, bytes[i]);
        if (!length) continue;
        if (!taxel_kind_of(decoder.bytes, length)) decoder.bad.message++;
        print_hex(decoder.bytes, length);
        printf(",");
      }
      taxel_bad *bad = &decoder.bad;
      printf(" %u %u %u %u %u ", bad->too_short, bad->too_long, bad->check, bad->cobs,
             bad->message);
      print_hex(decoder.bytes, decoder.used);
    } else if (!strncmp(line, "fresh", 5)) {
      memset(&decoder, 0, sizeof decoder);
    }
    printf("\n");
    fflush(stdout);
  }
  return 0;
}
