/* SPDX-License-Identifier: Apache-2.0 */
#include "taxel_cnn.h"

#include <string.h>

#ifdef __AVR__
#pragma GCC optimize("O2") /* the Arduino IDE compiles for size: a tenth slower */
#endif

/* Numbers in flash are read with pgm_read_*, not through __flash: avr-gcc 5.4 -O2 reads members of
 * a __flash struct from RAM. */
#ifdef __AVR__
#include <avr/pgmspace.h>
typedef __int24 acc;
#define CHECKED(sum) (sum)
#define FLASH_I8(at) ((int8_t)pgm_read_byte(at))
#define FLASH_U8(at) pgm_read_byte(at)
#define FLASH_U16(at) pgm_read_word(at)
#define FLASH_I32(at) ((int32_t)pgm_read_dword(at))
#else
#define PROGMEM
typedef int32_t acc;
uint32_t taxel_overflows;
static inline acc checked(acc sum) {
  if (sum > 8388607L || sum < -8388608L) taxel_overflows++;
  return sum;
}
#define CHECKED(sum) checked(sum)
#define FLASH_I8(at) (*(at))
#define FLASH_U8(at) (*(at))
#define FLASH_U16(at) (*(at))
#define FLASH_I32(at) (*(at))
#endif

/* What a filter has beside its weights. */
typedef struct {
  int32_t bias;
  uint16_t multiplier;
  uint8_t shift;
} filter;

#include "taxel_weights.h"

#define ROWS_1 ((TAXEL_ROWS + 1) / 2) /* after the first pooling, */
#define COLUMNS_1 ((TAXEL_COLUMNS + 1) / 2)
#define ROWS_2 ((ROWS_1 + 1) / 2) /* and after the second */
#define COLUMNS_2 ((COLUMNS_1 + 1) / 2)
#define FLAT (ROWS_2 * COLUMNS_2 * TAXEL_FILTERS_2)
#define ROW_1 (COLUMNS_1 * TAXEL_FILTERS_1) /* bytes from one row to the next */
#define LEAST (-8388607L)

taxel_input taxel_image[TAXEL_ROWS + 2][TAXEL_COLUMNS + 2];
int32_t taxel_logits[TAXEL_CLASSES];
static uint8_t one[ROWS_1 * ROW_1]; /* filters last, so that a sum runs over bytes in a row */
static uint8_t two[FLAT];
static uint8_t hidden[TAXEL_HIDDEN];

/* e^(-i/16) * 65535: integers.py makes the same. */
static const uint16_t exps[128] PROGMEM = {TAXEL_EXPS};

#if defined(__AVR__) && !defined(TAXEL_PLAIN_C) && TAXEL_COLUMNS <= 28
#define TAXEL_FAST 1
/* What the compiler makes of a sum of products takes twice the clocks. Here a product takes six:
 * the multiplication leaves its bit 15 in the carry, which is the byte above it. */
#define PRODUCT(multiply, load_weight, load_value)                                              \
  load_weight "\n\t" load_value "\n\t" multiply " %[weight], %[value]\n\t"                      \
              "sbc %[above], %[above]\n\t"                                                      \
              "add %A[sum], r0\n\tadc %B[sum], r1\n\tadc %C[sum], %[above]\n\t"
#define IN_A_ROW PRODUCT("mulsu", "lpm %[weight], Z+", "ld %[value], X+")
#else
#define TAXEL_FAST 0
#endif
/* Plain C for hosts, and for compilers and images that the above does not fit. */
#define TAKE(sum, x, w) ((sum) = CHECKED((acc)((sum) + (int16_t)((int16_t)(x) * (w)))))

/* Add 8 * eights products of bytes in a row. */
static inline acc add_products(acc sum, const uint8_t *x, const int8_t *w,
                               uint8_t eights) {
#if TAXEL_FAST
  uint8_t above, weight, value;
  __asm__ volatile(
      "1:\n\t" IN_A_ROW IN_A_ROW IN_A_ROW IN_A_ROW IN_A_ROW IN_A_ROW IN_A_ROW IN_A_ROW
      "dec %[eights]\n\tbrne 1b\n\tclr __zero_reg__"
      : [sum] "+r"(sum), [above] "=&r"(above), [weight] "=&a"(weight), [value] "=&a"(value),
        [eights] "+r"(eights), "+x"(x), "+z"(w)
      :
      : "memory");
#else
  for (uint8_t i = 8; eights; i = 8, eights--)
    for (; i; i--, x++, w++) TAKE(sum, *x, FLASH_I8(w));
#endif
  return sum;
}

/* A sum as 8 bits; below 0 it is 0, which is the ReLU. */
static uint8_t to_byte(acc sum, const filter *f) {
  if (sum <= 0) return 0;
  uint32_t part = (uint32_t)sum >> FLASH_U8(&f->shift);
  uint16_t low = part > 0xFFFF ? 0xFFFF : (uint16_t)part;
  uint16_t found = (uint16_t)(((uint32_t)low * FLASH_U16(&f->multiplier)) >> 16) >> 7;
  return found > 255 ? 255 : (uint8_t)found;
}

void taxel_set_row(uint8_t row, const uint16_t counts[TAXEL_COLUMNS]) {
  for (uint8_t c = 0; c < TAXEL_COLUMNS; c++) {
    int32_t value = ((int32_t)counts[c] * FLASH_I32(&input_factor[c]) + FLASH_I32(&input_offset[c])) >>
                    16;
    if (value < TAXEL_INPUT_LEAST) value = TAXEL_INPUT_LEAST;
    if (value > TAXEL_INPUT_LARGEST) value = TAXEL_INPUT_LARGEST;
    taxel_image[row + 1][c + 1] = (taxel_input)value;
  }
}

#if TAXEL_SIGNED_INPUT
#define FROM_IMAGE(at) PRODUCT("muls", "ld %[weight], X+", "ldd %[value], Z+%[" at "]")
#else
#define FROM_IMAGE(at) PRODUCT("mulsu", "ld %[weight], X+", "ldd %[value], Z+%[" at "]")
#endif

/* The sum of one filter of the first layer at one pixel; x is its upper left neighbour. */
static inline acc nine(acc sum, const taxel_input *x, const int8_t *w) {
  enum { DOWN = TAXEL_COLUMNS + 2 };
#if TAXEL_FAST
  uint8_t above, weight, value;
  __asm__ volatile(
      FROM_IMAGE("a") FROM_IMAGE("b") FROM_IMAGE("c") FROM_IMAGE("d") FROM_IMAGE("e")
      FROM_IMAGE("f") FROM_IMAGE("g") FROM_IMAGE("h") FROM_IMAGE("i") "clr __zero_reg__"
      : [sum] "+r"(sum), [above] "=&r"(above), [weight] "=&a"(weight), [value] "=&a"(value),
        "+x"(w)
      : "z"(x), [a] "I"(0), [b] "I"(1), [c] "I"(2), [d] "I"(DOWN), [e] "I"(DOWN + 1),
        [f] "I"(DOWN + 2), [g] "I"(2 * DOWN), [h] "I"(2 * DOWN + 1), [i] "I"(2 * DOWN + 2)
      : "memory");
#else
  for (uint8_t row = 0; row < 3; row++, x += DOWN, w += 3) {
    TAKE(sum, x[0], w[0]);
    TAKE(sum, x[1], w[1]);
    TAKE(sum, x[2], w[2]);
  }
#endif
  return sum;
}

/* Filter by filter; the largest of 2 * 2 pixels is kept. */
static void first_layer(void) {
  for (uint8_t f = 0; f < TAXEL_FILTERS_1; f++) {
    int8_t w[9];
    for (uint8_t i = 0; i < 9; i++) w[i] = FLASH_I8(&first_weights[f * 9 + i]);
    acc bias = (acc)FLASH_I32(&first_filters[f].bias);
    uint8_t *to = one + f;
    for (uint8_t r = 0; r < TAXEL_ROWS; r += 2) {
      const taxel_input *x = taxel_image[r];
      for (uint8_t c = 0; c < TAXEL_COLUMNS; c += 2, x += 2, to += TAXEL_FILTERS_1) {
        acc best = LEAST;
        for (uint8_t pixel = 0; pixel < 4; pixel++) {
          uint8_t down = pixel >> 1, right = pixel & 1;
          if (r + down >= TAXEL_ROWS || c + right >= TAXEL_COLUMNS) continue;
          acc sum = nine(bias, x + down * (TAXEL_COLUMNS + 2) + right, w);
          if (sum > best) best = sum;
        }
        *to = to_byte(best, &first_filters[f]);
      }
    }
  }
}

/* Add the products of all filters at one pixel of the second layer to what the best pixel of its
 * four has. Rows and columns outside the image hold zeros and are left out. */
static void second_pixel(uint8_t r, uint8_t c, acc best[TAXEL_FILTERS_2]) {
  uint8_t top = r == 0, left = c == 0;
  uint8_t rows = (uint8_t)(3 - top - (r == ROWS_1 - 1));
  uint8_t columns = (uint8_t)(3 - left - (c == COLUMNS_1 - 1));
  uint8_t eights = columns * (TAXEL_FILTERS_1 / 8);
  const uint8_t *from = one + (r + top - 1) * ROW_1 + (c + left - 1) * TAXEL_FILTERS_1;
  const int8_t *weights = second_weights + (top * 3 + left) * TAXEL_FILTERS_1;
  for (uint8_t f = 0; f < TAXEL_FILTERS_2; f++, weights += 9 * TAXEL_FILTERS_1) {
    acc sum = (acc)FLASH_I32(&second_filters[f].bias);
    const uint8_t *x = from;
    const int8_t *w = weights;
    for (uint8_t row = rows; row; row--, x += ROW_1, w += 3 * TAXEL_FILTERS_1)
      sum = add_products(sum, x, w, eights);
    if (sum > best[f]) best[f] = sum;
  }
}

static void second_layer(void) {
  acc best[TAXEL_FILTERS_2];
  uint8_t *to = two;
  for (uint8_t r = 0; r < ROWS_1; r += 2) {
    for (uint8_t c = 0; c < COLUMNS_1; c += 2) {
      for (uint8_t f = 0; f < TAXEL_FILTERS_2; f++) best[f] = LEAST;
      for (uint8_t pixel = 0; pixel < 4; pixel++) {
        uint8_t row = r + (pixel >> 1), column = c + (pixel & 1);
        if (row < ROWS_1 && column < COLUMNS_1) second_pixel(row, column, best);
      }
      for (uint8_t f = 0; f < TAXEL_FILTERS_2; f++) *to++ = to_byte(best[f], &second_filters[f]);
    }
  }
}

/* The likeliest class's share of the sum of e^logit over all classes. */
static uint8_t confidence(uint8_t best) {
  uint32_t total = 0;
  for (uint8_t k = 0; k < TAXEL_CLASSES; k++) {
    uint32_t behind = (uint32_t)(taxel_logits[best] - taxel_logits[k]) >> TAXEL_EXP_SHIFT;
    uint16_t part = behind > 0xFFFF ? 0xFFFF : (uint16_t)behind;
    uint16_t index = (uint16_t)(((uint32_t)part * TAXEL_EXP_MULTIPLIER) >> 16);
    if (index < 128) total += FLASH_U16(&exps[index]);
  }
  return (uint8_t)((65535UL * 255UL + total / 2) / total);
}

taxel_answer taxel_classify(void) {
  taxel_answer answer = {0, 0};
  first_layer();
  second_layer();
  for (uint8_t u = 0; u < TAXEL_HIDDEN; u++) {
    acc sum = add_products((acc)FLASH_I32(&hidden_filters[u].bias), two,
                           hidden_weights + (uint16_t)u * FLAT, FLAT / 8);
    hidden[u] = to_byte(sum, &hidden_filters[u]);
  }
  for (uint8_t k = 0; k < TAXEL_CLASSES; k++) {
    taxel_logits[k] = add_products((acc)FLASH_I32(&last_biases[k]), hidden,
                                   last_weights + k * TAXEL_HIDDEN, TAXEL_HIDDEN / 8);
    if (taxel_logits[k] > taxel_logits[answer.best]) answer.best = k;
  }
  answer.confidence = confidence(answer.best);
  return answer;
}

uint8_t taxel_self_check(void) {
  uint8_t same = 1, i = 0;
  for (uint8_t r = 1; r <= TAXEL_ROWS; r++)
    for (uint8_t c = 1; c <= TAXEL_COLUMNS; c++)
      taxel_image[r][c] = (taxel_input)FLASH_U8(&check_image[(r - 1) * TAXEL_COLUMNS + c - 1]);
  taxel_answer answer = taxel_classify();
  for (; i < TAXEL_CLASSES; i++) same &= taxel_logits[i] == FLASH_I32(&check_logits[i]);
  memset(taxel_image, 0, sizeof taxel_image);
  return same && answer.confidence == TAXEL_CHECK_CONFIDENCE;
}
