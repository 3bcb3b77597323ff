/* SPDX-License-Identifier: Apache-2.0
 *
 * What a sensor board decides: the order of its conversions, which rates it can do, and what it
 * answers. Plain C, tested on the host. Knows nothing about registers.
 */
#ifndef DAQ_LOGIC_H
#define DAQ_LOGIC_H

#include "taxel_message.h"

#ifdef __cplusplus
extern "C" {
#endif

#define DAQ_PINS 16

/* One conversion of a scan. */
typedef struct {
  uint8_t pin;  /* A0 is 0 */
  uint8_t keep; /* 0: read to empty the converter's capacitor, and thrown away */
} daq_step;

/* What a rate means to the timer. */
typedef struct {
  uint16_t rate_hz;
  uint16_t tick_us;      /* between interrupts, at most 32768 */
  uint16_t ticks_a_scan; /* interrupts from one scan to the next */
} daq_timing;

typedef struct {
  uint8_t board;
  uint8_t channels;
  uint8_t steps;
  uint8_t prescaler; /* of the converter's clock: 16, 32, 64 or 128 */
  uint32_t baud;
  taxel_session session;
} daq;

/* Write the conversions of a scan into steps[2 * DAQ_PINS]; return how many there are.
 * With ground_reads the pin below each channel is read first, where it is no channel itself. */
uint8_t daq_plan(const uint8_t *channels, uint8_t count, uint8_t ground_reads, daq_step *steps);

/* Whether a board can scan at this rate, and how. It cannot where the rate does not divide
 * 1,000,000, or its conversions or its frames take longer than a scan may. */
uint8_t daq_timing_of(const daq *board, uint16_t rate_hz, daq_timing *timing);

/* Take in a command for this board. Returns the result; *hello is set where one must be sent after
 * the acknowledge, *rate_hz to a new rate or left alone. */
uint8_t daq_obey(daq *board, const taxel_head *head, const taxel_command *command, uint8_t *hello,
                 uint16_t *rate_hz);

#ifdef __cplusplus
}
#endif
#endif
