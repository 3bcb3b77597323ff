/* SPDX-License-Identifier: Apache-2.0 */
#include "decision.h"

static uint8_t *put(uint8_t *to, uint32_t value) {
  for (uint8_t i = 0; i < 4; i++, value >>= 8) *to++ = (uint8_t)value;
  return to;
}

uint8_t taxel_pack_decision(uint8_t *payload, const taxel_head *head, const taxel_answer *answer,
                            uint8_t reason, uint32_t took_us) {
  uint8_t *to = payload;
  *to++ = TAXEL_DECISION;
  *to++ = head->board;
  to = put(to, head->seq);
  to = put(to, head->t_us);
  *to++ = reason == TAXEL_SURE ? answer->best : TAXEL_NO_CLASS;
  *to++ = answer->confidence;
  *to++ = reason;
  to = put(to, took_us);
  return (uint8_t)(to - payload);
}
