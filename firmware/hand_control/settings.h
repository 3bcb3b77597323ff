/* SPDX-License-Identifier: Apache-2.0
 *
 * What differs from hand to hand. Change it here, or give it to the compiler with -D.
 * Times and limits: our choice, docs/decisions/0020; measure your own actuators.
 */
#ifndef HAND_CONTROL_SETTINGS_H
#define HAND_CONTROL_SETTINGS_H

#ifndef TAXEL_BOARD
#define TAXEL_BOARD 3 /* its number in the hand */
#endif
#ifndef TAXEL_BOARD_ID
#define TAXEL_BOARD_ID "HAND"
#endif
#ifndef TAXEL_BAUD
#define TAXEL_BAUD 500000UL /* must divide 2,000,000 */
#endif

/* Four motors at most: PWM on pins 5, 6, 7, 8, direction on pins 22, 23, 24, 25 (high opens). */
#ifndef HAND_MOTORS
#define HAND_MOTORS 4
#endif
/* INA226 sensors by address, and which of them measures each motor. One for each motor, so that
 * one finger's contact stops that finger alone. The thesis's single sensor in the common supply:
 * addresses 0x40, motors 0, 0, 0, 0: contact then stops all that move. */
#ifndef HAND_SENSORS
#define HAND_SENSORS 0x40, 0x41, 0x44, 0x45
#endif
#ifndef HAND_SENSOR_OF_MOTOR
#define HAND_SENSOR_OF_MOTOR 0, 1, 2, 3
#endif
#ifndef HAND_SHUNT_MOHM
#define HAND_SHUNT_MOHM 10 /* milliohms: up to 8.19 A in steps of 0.25 mA. Modules say R010 or R100 */
#endif

#ifndef HAND_OVER_MA
#define HAND_OVER_MA 2500 /* stops everything: a fault */
#endif
#ifndef HAND_DUTY
#define HAND_DUTY 255 /* of 255 */
#endif
#ifndef HAND_STROKE_MS
#define HAND_STROKE_MS 5000 /* from open to closed at that duty, milliseconds */
#endif
#ifndef HAND_BLANK_MS
#define HAND_BLANK_MS 80 /* a motor's start-up peak, in which its current means no contact */
#endif
/* No heartbeat of the host for this long stops the hand. The specification says 200 ms at most;
 * with a tick of 1 ms this keeps it within 100. */
#ifndef HAND_WATCHDOG_MS
#define HAND_WATCHDOG_MS 95
#endif

#endif
