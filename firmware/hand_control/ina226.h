/* SPDX-License-Identifier: Apache-2.0
 *
 * The INA226 current sensor on the ATmega2560's I2C at 400 kHz, in which nothing waits forever.
 *
 * Only the shunt's voltage is read: 2.5 microvolts a count, sixteen bits with a sign. Knows
 * nothing about motors. Source: INA226 datasheet (TI SBOS547): registers 00h, 01h, FEh.
 */
#ifndef INA226_H
#define INA226_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define INA226_CONFIG 0x00
#define INA226_SHUNT 0x01
#define INA226_MAKER 0xFE
#define INA226_MAKER_IS 0x5449

/* Average of one, 588 us a conversion, the shunt only, over and over; bit 14 reads as 1. */
#define INA226_SETTING 0x4025

/* Switch the I2C on. */
void ina226_begin(void);

/* Set a sensor up; 0 where it does not answer or is no INA226. */
uint8_t ina226_set_up(uint8_t address);

/* Read a register; 0 where it failed: then the bus was freed as far as it can be. */
uint8_t ina226_read(uint8_t address, uint8_t what, uint16_t *value);

/* The size of a current, mA, of a shunt reading; 32767 where the reading is at its end. */
uint16_t ina226_milliamps(uint16_t counts, uint16_t shunt_mohm);

#ifdef __cplusplus
}
#endif
#endif
