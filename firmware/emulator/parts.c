/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Analog pins: a waveform with a zero-order hold, sampled when the converter samples.
 */
#include <string.h>

#include "avr_adc.h"
#include "emulated.h"

#define ADCSRA 0x7A
#define ADCSRB 0x7B
#define ADMUX 0x7C
#define MUX5 0x08

/* One conversion, as the log holds it: 16 bytes, little-endian. */
typedef struct {
  uint64_t cycle; /* of the sample: one and a half clocks of the converter after the start */
  uint8_t pin, reference;
  uint16_t tenths_mv, count, prescaler;
} __attribute__((packed)) conversion;

static avr_adc_t *converter_of(avr_t *avr) {
  for (avr_io_t *io = avr->io_port; io; io = io->next) {
    if (!strcmp(io->kind, "adc")) return (avr_adc_t *)io;
  }
  return NULL;
}

static void on_start(struct avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq, (void)value;
  emulated *board = param;
  avr_t *avr = board->avr;
  uint8_t mux = avr->data[ADMUX];
  uint16_t prescaler = (uint16_t)(1 << (avr->data[ADCSRA] & 7));
  conversion one = {.cycle = avr->cycle + prescaler * 3u / 2};
  one.prescaler = prescaler;
  one.pin = (uint8_t)((mux & 7) | (avr->data[ADCSRB] & MUX5 ? 8 : 0));
  one.reference = mux >> 6;
  if (board->rows) {
    uint64_t row = (unsigned __int128)(one.cycle - board->wave_from) * board->wave_hz / HZ;
    if (row >= board->rows) row = board->rows - 1;
    one.tenths_mv = board->wave[row * PINS + one.pin];
  }
  const uint32_t full_mv[4] = {board->aref_mv, 5000, 1100, 2560};
  uint32_t count = (uint32_t)one.tenths_mv * 1024 / (full_mv[one.reference] * 10);
  one.count = (uint16_t)(count > 1023 ? 1023 : count);
  if (board->log) fwrite(&one, sizeof one, 1, board->log);
  board->conversions++;
  /* simavr scales slot 0 by its own reference; this value comes out as exactly this count. */
  const uint32_t theirs[4] = {avr->aref, avr->avcc, 1100, 2560};
  avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0),
                (one.count * theirs[one.reference] + 1022) / 1023);
}

void attach_analog(emulated *board) {
  avr_adc_t *adc = converter_of(board->avr);
  /* simavr 1.6 has eight slots for sixteen pins: all pins read slot 0, filled as one is chosen. */
  for (int i = 0; i < 64; i++) {
    if (adc->muxmode[i].kind == ADC_MUX_SINGLE) adc->muxmode[i].src = 0;
  }
  board->avr->vcc = 5000;
  board->avr->avcc = board->avr->aref = 1023;
  avr_irq_register_notify(avr_io_getirq(board->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER),
                          on_start, board);
}
