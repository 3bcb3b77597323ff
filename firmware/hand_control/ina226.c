/* SPDX-License-Identifier: Apache-2.0 */
#include "ina226.h"

#include <avr/io.h>
#include <util/delay.h>
#include <util/twi.h>

/* A byte takes 25 us at 400 kHz and a loop half a microsecond: four bytes' time. */
#define LOOPS 200

static uint8_t started;

void ina226_begin(void) {
  TWSR = 0;
  TWBR = (uint8_t)((F_CPU / 400000UL - 16) / 2);
  TWCR = _BV(TWEN);
}

/* Do one thing on the bus; 1 where it ends in time as it should. */
static uint8_t step(uint8_t what, uint8_t wanted) {
  TWCR = (uint8_t)(_BV(TWINT) | _BV(TWEN) | what);
  for (uint8_t i = 0; i < LOOPS; i++) {
    if (TWCR & _BV(TWINT)) return TW_STATUS == wanted;
  }
  return 0;
}

static uint8_t start(uint8_t address_and_way) {
  if (!step(_BV(TWSTA), started ? TW_REP_START : TW_START)) return 0;
  started = 1;
  TWDR = address_and_way;
  return step(0, address_and_way & 1 ? TW_MR_SLA_ACK : TW_MT_SLA_ACK);
}

static uint8_t send(uint8_t byte) {
  TWDR = byte;
  return step(0, TW_MT_DATA_ACK);
}

static void stop(void) {
  TWCR = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);
  for (uint8_t i = 0; i < LOOPS && (TWCR & _BV(TWSTO)); i++) {
  }
  started = 0;
}

/* Free the bus: nine clocks let a sensor that was cut off end its byte. */
static void set_free(void) {
  TWCR = 0;
  PORTD |= _BV(PD0) | _BV(PD1);
  for (uint8_t i = 0; i < 9; i++) {
    PORTD &= (uint8_t)~_BV(PD0);
    DDRD |= _BV(PD0); /* SCL low */
    _delay_us(2);
    DDRD &= (uint8_t)~_BV(PD0); /* and let go */
    PORTD |= _BV(PD0);
    _delay_us(2);
  }
  ina226_begin();
  started = 0;
}

uint8_t ina226_read(uint8_t address, uint8_t what, uint16_t *value) {
  uint8_t way = (uint8_t)(address << 1);
  if (start(way | TW_WRITE) && send(what) && start(way | TW_READ) &&
      step(_BV(TWEA), TW_MR_DATA_ACK)) {
    uint8_t high = TWDR;
    if (step(0, TW_MR_DATA_NACK)) {
      *value = (uint16_t)(high << 8 | TWDR);
      stop();
      return 1;
    }
  }
  stop();
  set_free();
  return 0;
}

uint8_t ina226_set_up(uint8_t address) {
  uint16_t maker;
  if (!ina226_read(address, INA226_MAKER, &maker) || maker != INA226_MAKER_IS) return 0;
  uint8_t done = start((uint8_t)(address << 1) | TW_WRITE) && send(INA226_CONFIG) &&
                 send(INA226_SETTING >> 8) && send(INA226_SETTING & 0xFF);
  stop();
  if (!done) set_free();
  return done;
}

uint16_t ina226_milliamps(uint16_t counts, uint16_t shunt_mohm) {
  int16_t signed_counts = (int16_t)counts;
  if (signed_counts == INT16_MIN || signed_counts == INT16_MAX) return INT16_MAX;
  uint16_t size = (uint16_t)(signed_counts < 0 ? -signed_counts : signed_counts);
  uint32_t ma = (uint32_t)size * 5 / (2UL * shunt_mohm);
  return ma > INT16_MAX ? INT16_MAX : (uint16_t)ma;
}
