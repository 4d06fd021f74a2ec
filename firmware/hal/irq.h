// The interrupts' numbers, by which SDCC finds their vectors (datasheet chapter "CIP-51", interrupt summary).
#ifndef IRQ_H
#define IRQ_H

#define IRQ_UART0 4
#define IRQ_TIMER2 5
#define IRQ_PCA0 11
#define IRQ_TIMER3 14

#endif
