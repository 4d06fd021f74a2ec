//! Tests of the loop that runs a unit, with programs of a few instructions.

use super::*;
use crate::image::{erased, flash_firmware};
use crate::room::Room;
use crate::room::acoustics::Scene;
use crate::time::{Oscillator, TICKS_PER_MS};
use std::rc::Rc;

pub(super) const TICKS_PER_CLOCK: Tick = 32;

/// A unit that runs from address 0 at the clock of reset, behind it nothing but NOPs.
pub(super) fn unit(program: &[u8], service_routine: &[u8]) -> Unit {
    let room = Room::parse("x", "name = 'x'\n[unit]\nposition_m = [0.0, 0.0]\n").unwrap();
    let mut flash = erased();
    flash.fill(0);
    flash_firmware(&mut flash, &[(0, program.to_vec()), (0x2B, service_routine.to_vec())]);
    Unit::power_up(
        flash,
        World::new(Rc::new(Scene::new(room)), 0, Oscillator::off_by(0.0), None, 1, 1),
        1,
        &mut stream(2, Part::Memories),
    )
}

#[test]
fn one_instruction_runs_between_two_runs_of_a_routine_that_leaves_its_flag_up() {
    // ANL PCA0MD,#0xBF; MOV TMR2CN,#0x80; MOV IE,#0xA0
    let mut unit = unit(&[0x53, 0xD9, 0xBF, 0x75, 0xC8, 0x80, 0x75, 0xA8, 0xA0], &[0x32]);
    let start_up = 3 + 3 + 3;
    let (entry, reti, nop) = (6, 6, 1);
    unit.run_until((start_up + 100 * (nop + entry + reti)) * TICKS_PER_CLOCK).unwrap();
    assert_eq!(unit.instructions(), 3 + 200);
}

#[test]
fn on_the_slowest_chip_each_jump_that_is_taken_waits_for_its_target_and_movc_takes_its_longest() {
    let program = [
        0x53, 0xD9, 0xBF, // ANL PCA0MD,#0xBF
        0xE4, // CLR A
        0x70, 0x01, // JNZ: not taken
        0x60, 0x01, 0x00, // JZ over a NOP
        0x12, 0x00, 0x2B, // LCALL 0x002B
        0x93, // MOVC A,@A+DPTR
        0x80, 0xFE, // SJMP $
    ];
    let clocks = |slowest: bool| {
        let mut unit = unit(&program, &[0x22]); // RET
        if slowest {
            unit.slow_down();
        }
        while unit.instructions() < 8 {
            unit.run_until(unit.now() + 1).unwrap();
        }
        unit.now() / TICKS_PER_CLOCK
    };
    assert_eq!(clocks(false), 3 + 1 + 2 + 4 + 5 + 6 + 4 + 4);
    assert_eq!(clocks(true), 3 + 1 + 2 + (4 + 2) + (5 + 2) + (6 + 2) + 7 + (4 + 2));
}

#[test]
fn a_sleeping_chip_wakes_at_the_exact_tick_of_its_timer() {
    // ANL PCA0MD,#0xBF; MOV TMR2CN,#0x04; MOV IE,#0xA0; ORL PCON,#1; at the vector MOV P1,#0; NOPs
    let program = [0x53, 0xD9, 0xBF, 0x75, 0xC8, 0x04, 0x75, 0xA8, 0xA0, 0x43, 0x87, 0x01];
    let mut unit = unit(&program, &[0x75, 0x90, 0x00]);
    let overflow = 0x1_0000 * 12 * TICKS_PER_CLOCK;
    unit.run_until(overflow + 5 * TICKS_PER_CLOCK).unwrap();
    assert_eq!(unit.instructions(), 4);
    unit.run_until(overflow + 7 * TICKS_PER_CLOCK).unwrap();
    assert_eq!(unit.instructions(), 5);
}

#[test]
fn a_fault_names_the_instruction() {
    // NOP; NOP; MOV A,USB0ADR
    let fault = unit(&[0x00, 0x00, 0xE5, 0x96], &[]).run_until(1000 * TICKS_PER_CLOCK).unwrap_err();
    assert_eq!(fault.pc, 2);
    assert!(fault.to_string().starts_with("SFR 0x96 (USB0ADR) read is not modelled (PC 0x0002"), "{fault}");
}

#[test]
fn running_into_or_reading_the_reserved_area_resets_the_chip() {
    // ANL PCA0MD,#0xBF; LJMP 0xFC00
    let mut runs = unit(&[0x53, 0xD9, 0xBF, 0x02, 0xFC, 0x00], &[]);
    // ANL PCA0MD,#0xBF; MOV DPTR,#0xFC00; MOVC A,@A+DPTR
    let mut reads = unit(&[0x53, 0xD9, 0xBF, 0x90, 0xFC, 0x00, 0x93], &[]);
    for unit in [&mut runs, &mut reads] {
        unit.run_until(100 * TICKS_PER_CLOCK).unwrap();
        assert!(unit.resets() > 1);
    }
}

#[test]
fn a_fault_of_code_that_is_read_too_fast_says_so() {
    let image = [
        0x53, 0xD9, 0xBF, // ANL PCA0MD,#0xBF
        0x75, 0xB2, 0x83, // MOV OSCICN,#0x83
        0x75, 0xB9, 0x80, // MOV CLKMUL,#0x80
        0x78, 0x20, 0xD8, 0xFE, // MOV R0,#32; DJNZ R0,$
        0x75, 0xB9, 0xC0, // MOV CLKMUL,#0xC0
        0xE5, 0xB9, 0x30, 0xE5, 0xFB, // MOV A,CLKMUL; JNB ACC.5,back
        0x75, 0xA9, 0x03, // MOV CLKSEL,#3: 48 MHz, and FLSCL is as at reset
        0xE5, 0x96, 0xE5, 0x96, 0xE5, 0x96, // MOV A,USB0ADR: one of these will be read right
    ];
    let fault = unit(&image, &[]).run_until(100 * TICKS_PER_MS).unwrap_err();
    assert!(fault.to_string().contains("FLSCL.FLRT is clear"), "{fault}");
}
