/* SPDX-License-Identifier: Apache-2.0 */
#include "classify_board.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <string.h>

#include "TaxelWire.h"
#include "decision.h"
#include "settings.h"
#include "taxel_cnn.h"
#include "taxel_window.h"

#define BEAT_US 40000UL /* between heartbeats: with a window between two, still within 100 ms */
#define PRESCALER 128   /* of the converter's clock: 125 kHz, ten good bits */
#define STEP_US 7       /* from a conversion's end to the next one's start */
#define WAITING 8       /* scans; a power of two */
#define PERIOD_US (1000000UL / TAXEL_TICK_HZ)

static const uint8_t channels[] = {TAXEL_CHANNELS};
static const char board_id[] = TAXEL_BOARD_ID;
_Static_assert(sizeof channels == TAXEL_COLUMNS, "one pin for each channel of the network");
_Static_assert(sizeof board_id - 1 <= TAXEL_LONGEST_ID, "an id of at most 32 characters");
_Static_assert(2 * sizeof channels * (13 * PRESCALER / 16 + STEP_US) < PERIOD_US,
               "a scan longer than a row of the window");
_Static_assert(PERIOD_US <= 32768, "31 rows a second or more");

typedef struct {
  uint32_t tick, t_us;
  uint16_t counts[TAXEL_COLUMNS];
} scan;

static taxel_decoder decoder;
static taxel_session session;
static taxel_window window;
static uint32_t boot_id, beat_us;
static uint8_t sound; /* the build passed its self-check */

/* The interrupts write scans[newest], the main loop reads scans[oldest]. */
static scan scans[WAITING];
static volatile uint8_t newest, oldest;
static volatile uint32_t due, dropped; /* ticks since boot; scans taken for which there was no room */
static volatile uint8_t converting;
static uint8_t step; /* even: the grounded pin; odd: a channel */

static void start(void) {
  uint8_t pin = step & 1 ? channels[step >> 1] : TAXEL_GROUND_PIN;
  ADMUX = (uint8_t)(TAXEL_REFERENCE << REFS0 | (pin & 7));
  ADCSRB = pin > 7 ? _BV(MUX5) : 0;
  ADCSRA |= _BV(ADSC);
}

void taxel_on_tick(void) {
  uint32_t tick = due++;
  if (converting) return; /* cannot be, by the assertion above; if it were: a hole in seq */
  converting = 1;
  scans[newest].tick = tick;
  scans[newest].t_us = taxel_tick_us();
  step = 0;
  start();
}

ISR(ADC_vect) {
  uint16_t count = ADC; /* before the multiplexer moves on */
  uint8_t done = step++;
  if (step < 2 * sizeof channels) start();
  else converting = 0;
  if (done & 1) scans[newest].counts[done >> 1] = count;
  if (converting) return;
  uint8_t next = (newest + 1) & (WAITING - 1);
  if (next == oldest) dropped++;
  else newest = next;
}

static taxel_head head_now(void) {
  uint8_t sreg = SREG;
  cli();
  taxel_head head = {TAXEL_BOARD, due, 0};
  SREG = sreg;
  head.t_us = taxel_now_us();
  return head;
}

static void say_hello(void) {
  uint8_t payload[TAXEL_LONGEST_ID + 32];
  taxel_head head = head_now();
  taxel_hello hello = {
      .protocol = TAXEL_PROTOCOL,
      .firmware = {1, 0, 0},
      .boot_id = boot_id,
      .rate_hz = TAXEL_TICK_HZ,
      .channels = 0, /* it keeps its scans to itself */
      .adc_bits = 10,
      .reference_mv = TAXEL_MODEL_REFERENCE_MV,
      .abilities = TAXEL_DECISIONS,
      .id_size = sizeof board_id - 1,
      .id = board_id,
  };
  taxel_uart_send(payload, taxel_pack_hello(payload, &head, &hello));
}

static void hear(uint8_t size) {
  taxel_head head;
  taxel_command command;
  uint8_t payload[32];
  uint8_t kind = taxel_kind_of(decoder.bytes, size);
  if (kind == TAXEL_NO_MESSAGE) decoder.bad.message++;
  if (kind != TAXEL_COMMAND) return;
  taxel_read_head(decoder.bytes, &head);
  taxel_read_command(decoder.bytes, &command);
  if (head.board != TAXEL_BOARD && head.board != TAXEL_EVERY_BOARD) return;
  uint8_t identify = command.order == TAXEL_IDENTIFY;
  taxel_acknowledge answer = {head.seq, head.t_us, identify ? TAXEL_DONE : TAXEL_UNKNOWN};
  if (taxel_is_old(&session, head.seq, command.order)) answer.result = TAXEL_OLD;
  head = head_now();
  taxel_uart_send(payload, taxel_pack_acknowledge(payload, &head, &answer));
  if (answer.result == TAXEL_DONE) say_hello();
}

static void beat(void) {
  uint8_t payload[32];
  taxel_head head = head_now();
  if (head.t_us - beat_us < BEAT_US) return;
  beat_us = head.t_us;
  uint8_t sreg = SREG;
  cli();
  taxel_heartbeat beat = {sound ? TAXEL_IDLE : TAXEL_FAULT, dropped, 0};
  SREG = sreg;
  beat.bad = taxel_bad_total(&decoder.bad);
  taxel_uart_send(payload, taxel_pack_heartbeat(payload, &head, &beat));
}

/* Classify the window that this scan completed, and send the answer. */
static void classify(const scan *last) {
  uint8_t payload[TAXEL_DECISION_SIZE];
  taxel_head head = {TAXEL_BOARD, last->tick, last->t_us};
  beat();
  uint32_t began_us = taxel_now_us();
  taxel_answer answer = taxel_classify();
  uint32_t took_us = taxel_now_us() - began_us;
  uint8_t reason = taxel_doubt(&window, &answer);
  taxel_uart_send(payload, taxel_pack_decision(payload, &head, &answer, reason, took_us));
  taxel_window_next(&window);
}

/* Take in the oldest scan that waits. */
static void take_scan(void) {
  static uint32_t lost;
  uint8_t sreg = SREG;
  cli();
  uint32_t now_lost = dropped;
  SREG = sreg;
  if (now_lost != lost) { /* rows are missing: what was begun is no window */
    lost = now_lost;
    memset(&window, 0, sizeof window);
  }
  const scan *taken = &scans[oldest];
  if (taxel_window_push(&window, taken->tick, taken->counts) && sound) classify(taken);
  else if (window.rows == TAXEL_ROWS) taxel_window_next(&window);
  oldest = (oldest + 1) & (WAITING - 1);
}

void classify_begin(void) {
  DIDR0 = 0xFF; /* no digital inputs on the analog pins: less noise, less current */
  DIDR2 = 0xFF;
  ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
  sound = taxel_self_check();
  boot_id = taxel_boot_id();
  taxel_uart_begin(TAXEL_BAUD);
  taxel_tick_every((uint16_t)PERIOD_US);
  say_hello();
  set_sleep_mode(SLEEP_MODE_IDLE);
}

void classify_run(void) {
  int16_t byte;
  if (oldest != newest) take_scan();
  while ((byte = taxel_uart_read()) >= 0) {
    uint8_t size = taxel_decode(&decoder, (uint8_t)byte);
    if (size) hear(size);
  }
  beat();
  cli();
  if (oldest == newest && !taxel_uart_waiting()) { /* nothing to do until the next interrupt */
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}
