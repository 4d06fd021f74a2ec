// The C8051F340's registers, with the bit masks that the compiler's header leaves out. Included by hal/*.c alone.
// Names and bits as in the C8051F34x datasheet.
#ifndef CHIP_H
#define CHIP_H

#include <C8051F340.h>

// PCA0MD, PCA0CPMn
#define PCA0MD_SYSCLK_12 0x00
#define PCA0MD_ECF 0x01
#define PCA0MD_WDTE 0x40
#define PCA0CPM_ECCF 0x01
#define PCA0CPM_CAPN 0x10
#define PCA0CPM_CAPP 0x20

// timers
#define CKCON_T1M 0x08
#define TMOD_T1_AUTO_RELOAD 0x20
#define TMR2CN_TR2 0x04
#define TMR3CN_TR3 0x04
#define TMR3CN_FLAGS 0xC0

// interrupts
#define EIE1_EPCA0 0x10
#define EIE1_ET3 0x80

// oscillator and clock multiplier
#define OSCICN_12_MHZ 0x83
#define CLKMUL_MULEN 0x80
#define CLKMUL_MULINIT 0x40
#define CLKMUL_MULRDY 0x20
#define CLKSEL_4X 0x03

// flash, reset, power
#define FLSCL_FOSE 0x80
#define FLSCL_FLRT 0x10
#define PFE0CN_PFEN 0x20
#define PSCTL_PSWE 0x01
#define PSCTL_PSEE 0x02
#define VDM0CN_VDMEN 0x80
#define VDM0CN_VDDSTAT 0x40
#define RSTSRC_PORSF 0x02
#define RSTSRC_SWRSF 0x10
#define PCON_IDLE 0x01

// ADC and voltage reference
#define ADC0CN_AD0EN 0x80
#define ADC0CF_AD0SC_SHIFT 3
#define AMX0P_TEMPERATURE 0x1E
#define AMX0P_SUPPLY 0x1F
#define AMX0N_REFERENCE 0x1E
#define AMX0N_GROUND 0x1F
#define REF0CN_TEMPE 0x04
#define REF0CN_BIASE 0x02
#define REF0CN_REFBE 0x01

// UART and crossbar
#define SCON0_REN0 0x10
#define XBR0_URT0E 0x01
#define XBR1_CEX0 0x01
#define XBR1_XBARE 0x40

#endif
