/* SPDX-License-Identifier: Apache-2.0 */
#include "daq_logic.h"

#define LONGEST_TICK_US 32768UL /* timer 1: 65,536 halves of a microsecond */
#define ADC_CLOCKS 13           /* a conversion. Source: the ATmega2560's datasheet */
#define STEP_US 7               /* from a conversion's end to the next one's start; measured, 0020 */
#define BYTE_US 13              /* to pack, check and send a byte, all interrupts; measured, 0020 */
#define SCAN_US 12              /* from the timer's interrupt to the first start, and the end */

uint8_t daq_plan(const uint8_t *channels, uint8_t count, uint8_t ground_reads, daq_step *steps) {
  uint16_t wanted = 0;
  uint8_t used = 0;
  for (uint8_t i = 0; i < count; i++) wanted |= (uint16_t)(1U << channels[i]);
  for (uint8_t i = 0; i < count; i++) {
    uint8_t pin = channels[i];
    if (ground_reads && pin > 0 && !(wanted >> (pin - 1) & 1)) {
      steps[used].pin = (uint8_t)(pin - 1);
      steps[used++].keep = 0;
    }
    steps[used].pin = pin;
    steps[used++].keep = 1;
  }
  return used;
}

uint8_t daq_timing_of(const daq *board, uint16_t rate_hz, daq_timing *timing) {
  if (rate_hz == 0 || 1000000UL % rate_hz) return 0;
  uint32_t period_us = 1000000UL / rate_hz;
  uint32_t scan_us =
      SCAN_US + board->steps * (STEP_US + (uint32_t)ADC_CLOCKS * board->prescaler / 16);
  uint32_t frame = 10UL + 2UL * board->channels + 6;
  uint32_t busy_us = board->steps * STEP_US + frame * BYTE_US;
  /* Ten bits a byte; a tenth of the line and a twentieth of the processor stay free. */
  if (scan_us > period_us || frame * rate_hz * 100 > board->baud * 9 ||
      busy_us * 20 > period_us * 19) {
    return 0;
  }
  uint16_t parts = 1;
  while (period_us % parts || period_us / parts > LONGEST_TICK_US) parts++;
  timing->rate_hz = rate_hz;
  timing->tick_us = (uint16_t)(period_us / parts);
  timing->ticks_a_scan = parts;
  return 1;
}

uint8_t daq_obey(daq *board, const taxel_head *head, const taxel_command *command, uint8_t *hello,
                 uint16_t *rate_hz) {
  daq_timing timing;
  *hello = 0;
  if (taxel_is_old(&board->session, head->seq, command->order)) return TAXEL_OLD;
  switch (command->order) {
    case TAXEL_IDENTIFY:
      *hello = 1;
      return TAXEL_DONE;
    case TAXEL_SET_RATE:
      if (!daq_timing_of(board, command->a, &timing)) return TAXEL_BAD_ARGUMENT;
      *hello = 1;
      *rate_hz = command->a;
      return TAXEL_DONE;
    default: /* it has no motors */
      return TAXEL_UNKNOWN;
  }
}
