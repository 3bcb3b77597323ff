/* SPDX-License-Identifier: Apache-2.0
 *
 * What the Arduino core does around a sketch, as far as teng_classify needs it: tests then build
 * the sketch without the core.
 */
#include <avr/interrupt.h>

#include "classify_board.h"

int main(void) {
  sei();
  classify_begin();
  for (;;) classify_run();
}
