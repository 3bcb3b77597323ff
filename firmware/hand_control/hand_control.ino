/* SPDX-License-Identifier: Apache-2.0
 *
 * The TENG hand's motors, for the Arduino Mega 2560. Settings: settings.h. What it does:
 * hand_logic.h (plain C), ina226.h, hand_board.h (registers). How to: docs/how-to/firmware.md.
 */
#include <TaxelWire.h>

#include "hand_board.h"

void setup() { hand_begin_board(); }

void loop() { hand_run_board(); }
