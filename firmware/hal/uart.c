// UART0 (datasheet chapter of that name): timer 1 gives the baud rate, the service routine moves bytes between SBUF0
// and two rings.
#include "uart.h"

#include "timebase.h"
#include "timebase_stamp.h"

#define TIMER_CLOCKS_PER_HALF_BIT 208 // 48 MHz / 208 / 2 = 115,385 baud, 0.16 % fast
#define STAMP_BYTES 4
#define RING_FULL 255

// Rings of 256 bytes: a uint8_t index wraps by itself, and get == put means empty.
static __xdata uint8_t received[256];
static __xdata uint8_t sending[256];
static volatile uint8_t received_put;
static volatile uint8_t received_get;
static volatile uint8_t sending_put;
static volatile uint8_t sending_get;
static volatile uint16_t bytes_lost;
static volatile __bit after_delimiter;
static volatile __bit transmitting;

void uart_start(void)
{
    CKCON |= CKCON_T1M;
    TMOD = TMOD_T1_AUTO_RELOAD;
    TH1 = 256 - TIMER_CLOCKS_PER_HALF_BIT;
    TL1 = 256 - TIMER_CLOCKS_PER_HALF_BIT;
    TR1 = 1;
    SCON0 = SCON0_REN0;
    ES0 = 1;
}

bool uart_has_byte(void)
{
    return received_get != received_put;
}

uint8_t uart_take(void)
{
    return received[received_get++];
}

uint32_t uart_take_stamp(void)
{
    uint8_t low = uart_take();
    uint8_t high = uart_take();
    uint16_t wraps = uart_take();
    wraps |= (uint16_t)uart_take() << 8;
    return ((uint32_t)wraps << 16) | ((uint16_t)high << 8) | low;
}

uint16_t uart_bytes_lost(void)
{
    uint16_t lost;
    __critical
    {
        lost = bytes_lost;
    }
    return lost;
}

bool uart_has_room(void)
{
    return (uint8_t)(sending_put - sending_get) != RING_FULL;
}

void uart_send(uint8_t byte)
{
    sending[sending_put] = byte;
    __critical
    {
        sending_put++;
        if (!transmitting) {
            transmitting = 1;
            TI0 = 1; // the service routine takes it from here
        }
    }
}

void uart_send_at(uint8_t byte, uint32_t tick)
{
    while ((int32_t)(timebase_now() - tick) < 0)
        ;
    transmitting = 1;
    SBUF0 = byte;
}

bool uart_is_silent(void)
{
    return !transmitting;
}

void uart_isr(void) __interrupt(IRQ_UART0)
{
    if (RI0) {
        uint8_t low = PCA0L; // the stamp first, though few bytes need it: later it would be late
        uint8_t high = PCA0H;
        uint8_t byte = SBUF0;
        uint8_t used = received_put - received_get;
        RI0 = 0;
        if (byte != 0) {
            after_delimiter = 0;
            if (used < RING_FULL)
                received[received_put++] = byte;
            else
                bytes_lost++;
        } else if (!after_delimiter) {
            if (used < RING_FULL - STAMP_BYTES) {
                uint16_t wraps = timebase_wraps + (CF && high < 0x80);
                uint8_t at = received_put;
                after_delimiter = 1;
                received[at++] = 0;
                received[at++] = low;
                received[at++] = high;
                received[at++] = (uint8_t)wraps;
                received[at++] = wraps >> 8;
                received_put = at;
            } else {
                bytes_lost++;
            }
        }
    }
    if (TI0) {
        TI0 = 0;
        if (sending_get != sending_put)
            SBUF0 = sending[sending_get++];
        else
            transmitting = 0;
    }
}
