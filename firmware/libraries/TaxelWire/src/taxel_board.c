/* SPDX-License-Identifier: Apache-2.0 */
#ifdef __AVR__
#include "taxel_board.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>

#if F_CPU != 16000000UL
#error "written for 16 MHz: a tick of timer 1 is half a microsecond"
#endif

static volatile uint32_t due_us; /* when the last tick was due */
static uint16_t period_us;

ISR(TIMER1_COMPA_vect) {
  due_us += period_us;
  taxel_on_tick();
}

void taxel_tick_every(uint16_t period) {
  uint8_t sreg = SREG;
  cli();
  uint32_t now_us = period_us ? taxel_now_us() : 0;
  TIMSK0 = 0;
  TCCR1A = 0;
  TCCR1B = _BV(WGM12) | _BV(CS11); /* to OCR1A and over again, at 2 MHz */
  OCR1A = (uint16_t)(2UL * period - 1);
  TCNT1 = 0;
  TIFR1 = _BV(OCF1A);
  TIMSK1 = _BV(OCIE1A);
  due_us = now_us;
  period_us = period;
  SREG = sreg;
}

uint32_t taxel_now_us(void) {
  uint8_t sreg = SREG;
  cli();
  uint16_t count = TCNT1;
  uint32_t us = due_us;
  if (TIFR1 & _BV(OCF1A)) { /* a tick is due whose interrupt has not run yet */
    count = TCNT1;
    us += period_us;
  }
  SREG = sreg;
  return us + count / 2;
}

uint32_t taxel_tick_us(void) { return due_us; }

uint32_t taxel_boot_id(void) {
  uint32_t id = eeprom_read_dword((const uint32_t *)0) + 1;
  eeprom_update_dword((uint32_t *)0, id);
  return id;
}
#endif
