/* SPDX-License-Identifier: Apache-2.0
 *
 * The sensor board's logic on the host, for tests: one request a line, one answer a line.
 *
 *   plan GROUND_READS PIN…                 the conversions of a scan: pin, then + kept or - not
 *   board CHANNELS STEPS PRESCALER BAUD    a new board
 *   rate HZ                                "no", or microseconds a tick and ticks a scan
 *   do SEQ ORDER A                         result, whether a hello follows, the new rate or 0
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daq_logic.h"

static void plan(char *line) {
  uint8_t pins[DAQ_PINS], count = 0;
  daq_step steps[2 * DAQ_PINS];
  uint8_t ground_reads = (uint8_t)atoi(strtok(line + 5, " "));
  for (char *word = strtok(NULL, " "); word && count < DAQ_PINS; word = strtok(NULL, " "))
    pins[count++] = (uint8_t)atoi(word);
  uint8_t used = daq_plan(pins, count, ground_reads, steps);
  for (uint8_t i = 0; i < used; i++)
    printf("%s%u%c", i ? " " : "", steps[i].pin, steps[i].keep ? '+' : '-');
}

int main(void) {
  static daq board;
  char line[256];
  while (fgets(line, sizeof line, stdin)) {
    unsigned a, b, c, d;
    daq_timing timing;
    if (!strncmp(line, "plan ", 5)) {
      plan(line);
    } else if (sscanf(line, "board %u %u %u %u", &a, &b, &c, &d) == 4) {
      board = (daq){.channels = (uint8_t)a, .steps = (uint8_t)b, .prescaler = (uint8_t)c, .baud = d};
    } else if (sscanf(line, "rate %u", &a) == 1) {
      if (daq_timing_of(&board, (uint16_t)a, &timing))
        printf("%u %u", timing.tick_us, timing.ticks_a_scan);
      else printf("no");
    } else if (sscanf(line, "do %u %u %u", &a, &b, &c) == 3) {
      taxel_head head = {0, a, 0};
      taxel_command command = {.order = (uint8_t)b, .a = (uint16_t)c};
      uint8_t hello = 0;
      uint16_t rate_hz = 0;
      unsigned result = daq_obey(&board, &head, &command, &hello, &rate_hz);
      printf("%u %u %u", result, hello, rate_hz);
    } else {
      return 1;
    }
    printf("\n");
    fflush(stdout);
  }
  return 0;
}
