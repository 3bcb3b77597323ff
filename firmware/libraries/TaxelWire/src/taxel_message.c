/* SPDX-License-Identifier: Apache-2.0 */
#include "taxel_message.h"

#define HEAD 10
#define HELLO 26
#define COMMAND 19
#define HEARTBEAT 19
#define ACKNOWLEDGE 19

static uint8_t *put_u16(uint8_t *to, uint16_t value) {
  *to++ = (uint8_t)value;
  *to++ = (uint8_t)(value >> 8);
  return to;
}

static uint8_t *put_u32(uint8_t *to, uint32_t value) {
  return put_u16(put_u16(to, (uint16_t)value), (uint16_t)(value >> 16));
}

static uint16_t get_u16(const uint8_t *from) { return (uint16_t)(from[0] | (from[1] << 8)); }

static uint32_t get_u32(const uint8_t *from) {
  return get_u16(from) | ((uint32_t)get_u16(from + 2) << 16);
}

static uint8_t *put_head(uint8_t *to, uint8_t kind, const taxel_head *head) {
  *to++ = kind;
  *to++ = head->board;
  return put_u32(put_u32(to, head->seq), head->t_us);
}

static uint8_t printable(char byte) { return byte >= 0x20 && byte < 0x7F; }

uint8_t taxel_is_old(taxel_session *session, uint32_t seq, uint8_t order) {
  uint32_t step = seq - session->last;
  uint8_t newer = !session->heard || (step != 0 && step < 0x80000000UL);
  if (newer || order == TAXEL_IDENTIFY) {
    session->last = seq;
    session->heard = 1;
  }
  return !newer && order != TAXEL_IDENTIFY && order != TAXEL_STOP;
}

uint8_t taxel_pack_hello(uint8_t *payload, const taxel_head *head, const taxel_hello *hello) {
  if (hello->id_size > TAXEL_LONGEST_ID) return 0;
  uint8_t *to = put_head(payload, TAXEL_HELLO, head);
  *to++ = hello->protocol;
  for (uint8_t i = 0; i < 3; i++) *to++ = hello->firmware[i];
  to = put_u16(put_u32(to, hello->boot_id), hello->rate_hz);
  *to++ = hello->channels;
  *to++ = hello->adc_bits;
  to = put_u16(to, hello->reference_mv);
  *to++ = hello->abilities;
  *to++ = hello->id_size;
  for (uint8_t i = 0; i < hello->id_size; i++) *to++ = (uint8_t)hello->id[i];
  return taxel_kind_of(payload, (uint8_t)(to - payload)) ? (uint8_t)(to - payload) : 0;
}

uint8_t taxel_pack_data(uint8_t *payload, const taxel_head *head, const uint16_t *values,
                        uint8_t channels) {
  if (channels == 0 || channels > TAXEL_LONGEST_LIST) return 0;
  uint8_t *to = put_head(payload, TAXEL_DATA, head);
  for (uint8_t i = 0; i < channels; i++) to = put_u16(to, values[i]);
  return (uint8_t)(to - payload);
}

uint8_t taxel_pack_command(uint8_t *payload, const taxel_head *head,
                           const taxel_command *command) {
  uint8_t *to = put_head(payload, TAXEL_COMMAND, head);
  *to++ = command->order;
  put_u16(put_u16(put_u16(put_u16(to, command->expires_ms), command->a), command->b), command->c);
  return COMMAND;
}

uint8_t taxel_pack_heartbeat(uint8_t *payload, const taxel_head *head,
                             const taxel_heartbeat *beat) {
  uint8_t *to = put_head(payload, TAXEL_HEARTBEAT, head);
  *to++ = beat->state;
  put_u32(put_u32(to, beat->dropped), beat->bad);
  return HEARTBEAT;
}

uint8_t taxel_pack_acknowledge(uint8_t *payload, const taxel_head *head,
                               const taxel_acknowledge *answer) {
  uint8_t *to = put_head(payload, TAXEL_ACKNOWLEDGE, head);
  to = put_u32(put_u32(to, answer->command_seq), answer->host_us);
  *to = answer->result;
  return ACKNOWLEDGE;
}

uint8_t taxel_pack_current(uint8_t *payload, const taxel_head *head, const int16_t *milliamps,
                           uint8_t motors) {
  if (motors == 0 || motors > TAXEL_LONGEST_LIST) return 0;
  uint8_t *to = put_head(payload, TAXEL_CURRENT, head);
  for (uint8_t i = 0; i < motors; i++) to = put_u16(to, (uint16_t)milliamps[i]);
  return (uint8_t)(to - payload);
}

static uint8_t hello_is_sound(const uint8_t *payload, uint8_t size) {
  if (size < HELLO) return 0;
  uint8_t id_size = payload[HELLO - 1];
  if (id_size > TAXEL_LONGEST_ID || size != HELLO + id_size) return 0;
  for (uint8_t i = HELLO; i < size; i++) {
    if (!printable((char)payload[i])) return 0;
  }
  uint8_t bits = payload[21];
  return get_u16(payload + 18) && payload[20] <= TAXEL_LONGEST_LIST && bits >= 8 && bits <= 16 &&
         get_u16(payload + 22);
}

uint8_t taxel_kind_of(const uint8_t *payload, uint8_t size) {
  if (size < HEAD) return TAXEL_NO_MESSAGE;
  uint8_t kind = payload[0];
  switch (kind) {
    case TAXEL_HELLO:
      return hello_is_sound(payload, size) ? kind : TAXEL_NO_MESSAGE;
    case TAXEL_DATA:
    case TAXEL_CURRENT:
      return size > HEAD && (size - HEAD) % 2 == 0 ? kind : TAXEL_NO_MESSAGE;
    case TAXEL_COMMAND:
    case TAXEL_HEARTBEAT:
    case TAXEL_ACKNOWLEDGE: /* all three of one length */
      return size == COMMAND ? kind : TAXEL_NO_MESSAGE;
    default:
      return TAXEL_NO_MESSAGE;
  }
}

void taxel_read_head(const uint8_t *payload, taxel_head *head) {
  head->board = payload[1];
  head->seq = get_u32(payload + 2);
  head->t_us = get_u32(payload + 6);
}

void taxel_read_hello(const uint8_t *payload, taxel_hello *hello) {
  hello->protocol = payload[10];
  for (uint8_t i = 0; i < 3; i++) hello->firmware[i] = payload[11 + i];
  hello->boot_id = get_u32(payload + 14);
  hello->rate_hz = get_u16(payload + 18);
  hello->channels = payload[20];
  hello->adc_bits = payload[21];
  hello->reference_mv = get_u16(payload + 22);
  hello->abilities = payload[24];
  hello->id_size = payload[25];
  hello->id = (const char *)payload + HELLO;
}

void taxel_read_command(const uint8_t *payload, taxel_command *command) {
  command->order = payload[10];
  command->expires_ms = get_u16(payload + 11);
  command->a = get_u16(payload + 13);
  command->b = get_u16(payload + 15);
  command->c = get_u16(payload + 17);
}

void taxel_read_heartbeat(const uint8_t *payload, taxel_heartbeat *beat) {
  beat->state = payload[10];
  beat->dropped = get_u32(payload + 11);
  beat->bad = get_u32(payload + 15);
}

void taxel_read_acknowledge(const uint8_t *payload, taxel_acknowledge *answer) {
  answer->command_seq = get_u32(payload + 10);
  answer->host_us = get_u32(payload + 14);
  answer->result = payload[18];
}

uint8_t taxel_list_size(uint8_t size) { return (uint8_t)((size - HEAD) / 2); }

uint16_t taxel_list_value(const uint8_t *payload, uint8_t index) {
  return get_u16(payload + HEAD + 2 * index);
}
