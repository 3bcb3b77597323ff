/* SPDX-License-Identifier: Apache-2.0
 *
 * What every board of taxel needs of its ATmega2560: a tick, a clock, a number for each boot.
 *
 * Timer 1 makes the tick; timer 0's interrupt (millis, delay) is switched off, so that
 * nothing but this sketch's own interrupts moves a scan. Knows nothing about messages.
 */
#ifndef TAXEL_BOARD_H
#define TAXEL_BOARD_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Written by the sketch; called in the timer's interrupt, once every period. */
void taxel_on_tick(void);

/* Begin to tick every period_us microseconds, 1 to 32768; again, to change it. The clock goes on. */
void taxel_tick_every(uint16_t period_us);

/* Microseconds since the first tick was set up; wraps at 2^32. Not for use in interrupts. */
uint32_t taxel_now_us(void);

/* Microseconds of the tick whose interrupt is running: when it was due, not when it was served. */
uint32_t taxel_tick_us(void);

/* A number that is another at each boot, kept in the first four bytes of the EEPROM. */
uint32_t taxel_boot_id(void);

#ifdef __cplusplus
}
#endif
#endif
