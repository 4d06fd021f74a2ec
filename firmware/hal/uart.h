// UART0 at 115200 baud, with a ring of 255 bytes each way.
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

#include "irq.h"

void uart_start(void);

// Whether a byte is there to be taken.
bool uart_has_byte(void);

// Takes the oldest byte received. After a 0x00, uart_take_stamp() must be called next: the tick at which it came in.
// Of several 0x00 in a row only the first is kept.
uint8_t uart_take(void);
uint32_t uart_take_stamp(void);

// Bytes that came in while the ring was full.
uint16_t uart_bytes_lost(void);

bool uart_has_room(void);

// Sends a byte after those sent before; there must be room.
void uart_send(uint8_t byte);

// Sends a byte as soon as `tick` has come; the line must be silent.
void uart_send_at(uint8_t byte, uint32_t tick);

// True when the last byte has left.
bool uart_is_silent(void);

void uart_isr(void) __interrupt(IRQ_UART0);

#endif
