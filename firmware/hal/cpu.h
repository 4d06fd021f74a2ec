// The CPU itself: letting interrupts in, and sleeping until one comes.
#ifndef CPU_H
#define CPU_H

// To be called once every module that has an interrupt is started.
void cpu_allow_interrupts(void);

// Stops the CPU until an interrupt has been served.
void cpu_sleep(void);

#endif
