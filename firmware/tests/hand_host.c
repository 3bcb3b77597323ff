/* SPDX-License-Identifier: Apache-2.0
 *
 * The hand's logic on the host, for tests: one event a line on stdin, one answer a line on stdout.
 *
 *   start MOTORS SENSORS            sensor 0 for all motors where SENSORS is 1
 *   beat NOW_MS                     a heartbeat of the host
 *   do NOW_MS SEQ ORDER EXPIRES_MS A B C
 *   ms NOW_MS GOOD MA GOOD MA …     a tick, then a reading of each sensor
 *
 * Answer: result of "do", or 1 where a tick says that a grip ran out, or 0; the state; and for each
 * motor its direction and where it is.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hand_logic.h"

int main(void) {
  static const uint8_t own[] = {0, 1, 2, 3}, shared[] = {0, 0, 0, 0};
  static hand it;
  hand_config config = {
      .motors = 4, .sensor_of_motor = own, .sensors = 4, .over_ma = 2500, .stroke_ms = 1000,
      .blank_ms = 80, .watchdog_ms = 95, .reverse_ms = 50, .contact_readings = 3,
      .over_readings = 2, .lost_readings = 2, .good_readings = 10,
  };
  char line[256];
  hand_start(&it, &config);
  while (fgets(line, sizeof line, stdin)) {
    unsigned now = 0, seq, a, b, c, order, expires, result = 0;
    if (sscanf(line, "start %u %u", &a, &b) == 2) {
      config.motors = (uint8_t)a;
      config.sensors = (uint8_t)b;
      config.sensor_of_motor = b == 1 ? shared : own;
      hand_start(&it, &config);
    } else if (sscanf(line, "beat %u", &now) == 1) {
      hand_beat(&it, now);
    } else if (sscanf(line, "do %u %u %u %u %u %u %u", &now, &seq, &order, &expires, &a, &b,
                      &c) == 7) {
      taxel_head head = {3, seq, 0};
      taxel_command command = {(uint8_t)order, (uint16_t)expires, (uint16_t)a, (uint16_t)b,
                               (uint16_t)c};
      result = hand_obey(&it, &head, &command, now);
    } else if (!strncmp(line, "ms ", 3)) {
      now = (unsigned)strtoul(strtok(line + 3, " "), NULL, 10);
      result = hand_tick(&it, now);
      for (uint8_t s = 0; s < config.sensors; s++) {
        uint8_t good = (uint8_t)atoi(strtok(NULL, " "));
        hand_reading(&it, s, good, (uint16_t)atoi(strtok(NULL, " ")), now);
      }
    } else {
      return 1;
    }
    printf("%u %u", result, it.state);
    for (uint8_t m = 0; m < config.motors; m++)
      printf(" %d %d", it.motor[m].on, (int)it.motor[m].at_ms);
    printf("\n");
    fflush(stdout);
  }
  return 0;
}
