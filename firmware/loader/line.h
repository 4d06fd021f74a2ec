// Frames over UART0 at 115200 baud, looked at and waited for: nothing comes in while something goes out.
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

// The frame that has come, type first, without its CRC, and the one to go.
extern __xdata uint8_t line_frame[];
extern uint8_t line_length;

// At 12 MHz.
void line_start(void);

#define LINE_FRAME 0xFF

// Takes the byte that may have come in. Gives REASON_NONE until that ends a frame; then LINE_FRAME if the frame is
// sound, else the enum reason why it is not. The frame stays until the next byte.
uint8_t line_receive(void);

// Compose a frame and send it.
void line_begin(uint8_t type);
void line_put8(uint8_t value);
void line_put32(uint32_t value);
void line_send(void);

#endif
