//! Tests of the PCA against the rules of the datasheet's chapter.

use super::pca::Pca;
use super::sfr;
use crate::time::NEVER;

const COUNT: u64 = 12;

/// At 48 MHz, the watchdog off, counting SYSCLK/12.
fn running() -> Pca {
    let mut pca = Pca::new(1, 0);
    pca.write(sfr::PCA0MD, 0).unwrap();
    pca.write(sfr::PCA0CN, 0x40).unwrap();
    pca
}

fn count(pca: &Pca) -> u16 {
    u16::from_le_bytes([pca.read(sfr::PCA0L), pca.read(sfr::PCA0H)])
}

#[test]
fn the_counter_runs_at_a_twelfth_of_sysclk() {
    let mut pca = running();
    pca.sync(1000 * COUNT);
    assert_eq!(count(&pca), 1000);
}

#[test]
fn reading_the_low_byte_latches_the_high_byte() {
    let mut pca = running();
    pca.sync(0x12FF * COUNT);
    assert_eq!(pca.read(sfr::PCA0L), 0xFF);
    pca.sync(0x1300 * COUNT);
    assert_eq!(pca.read(sfr::PCA0H), 0x12);
}

#[test]
fn both_edges_are_captured_at_their_own_time() {
    let mut pca = running();
    pca.write(sfr::PCA0CPM0, 0x31).unwrap();
    pca.edge(0, true, 500 * COUNT + 11);
    assert_eq!((pca.read(sfr::PCA0CPL0), pca.read(sfr::PCA0CPH0)), (0xF4, 0x01));
    assert!(pca.pending());
    pca.write(sfr::PCA0CN, 0x40).unwrap();
    assert!(!pca.pending());
    pca.edge(0, false, 501 * COUNT);
    assert_eq!(pca.read(sfr::PCA0CPL0), 0xF5);
    assert!(pca.pending());
}

#[test]
fn an_edge_that_the_module_does_not_watch_is_not_captured() {
    let mut pca = running();
    pca.write(sfr::PCA0CPM0, 0x21).unwrap();
    pca.edge(0, false, 500 * COUNT);
    assert_eq!(pca.read(sfr::PCA0CN) & 1, 0);
}

#[test]
fn a_wrap_sets_cf_and_asks_for_an_interrupt_if_ecf_is_set() {
    let mut pca = running();
    assert_eq!(pca.next_event(), 65536 * COUNT);
    pca.sync(65536 * COUNT);
    assert_eq!(pca.read(sfr::PCA0CN) & 0x80, 0x80);
    assert!(!pca.pending());
    pca.write(sfr::PCA0MD, 0x01).unwrap();
    assert!(pca.pending());
}

#[test]
fn a_software_timer_matches_at_its_count_and_again_a_wrap_later() {
    let mut pca = running();
    pca.write(sfr::PCA0CPM0 + 1, 0x09).unwrap();
    pca.write(sfr::PCA0CPL1, 0x00).unwrap();
    pca.write(sfr::PCA0CPL1 + 1, 0x10).unwrap();
    assert_eq!(pca.next_event(), 0x1000 * COUNT);
    pca.sync(0x1000 * COUNT);
    assert!(pca.pending());
    pca.write(sfr::PCA0CN, 0x40).unwrap();
    pca.sync(0x1_0000 * COUNT);
    assert_eq!(pca.next_event(), 0x1_1000 * COUNT);
}

#[test]
fn after_a_reset_the_watchdog_bites_after_256_counts() {
    let ticks_per_sysclk = 32;
    assert_eq!(Pca::new(ticks_per_sysclk, 0).next_event(), 256 * 12 * ticks_per_sysclk);
}

#[test]
fn feeding_puts_the_watchdog_off_by_its_offset() {
    let mut pca = running();
    pca.sync(0x30 * COUNT);
    pca.write(sfr::PCA0CPL4, 0xFF).unwrap();
    pca.write(sfr::PCA0MD, 0x40).unwrap();
    pca.write(sfr::PCA0CPH4, 0).unwrap();
    let timeout = 256 * 0xFF + 256 - 0x30;
    pca.sync((0x30 + timeout) * COUNT - 1);
    assert!(!pca.watchdog_bites());
    pca.sync((0x30 + timeout) * COUNT);
    assert!(pca.watchdog_bites());
}

#[test]
fn the_clock_source_is_frozen_while_the_watchdog_is_enabled() {
    let mut pca = Pca::new(1, 0);
    pca.write(sfr::PCA0MD, 0x48).unwrap();
    assert_eq!(pca.read(sfr::PCA0MD), 0x40);
    pca.write(sfr::PCA0MD, 0x08).unwrap();
    assert_eq!(pca.read(sfr::PCA0MD), 0x00);
    pca.write(sfr::PCA0MD, 0x08).unwrap();
    assert_eq!(pca.read(sfr::PCA0MD), 0x08);
}

#[test]
fn a_locked_watchdog_stays_enabled() {
    let mut pca = running();
    pca.write(sfr::PCA0MD, 0x60).unwrap();
    pca.write(sfr::PCA0MD, 0x00).unwrap();
    assert_eq!(pca.read(sfr::PCA0MD), 0x60);
}

#[test]
fn cidl_stops_the_counter_in_idle_mode() {
    let mut pca = running();
    pca.write(sfr::PCA0MD, 0x80).unwrap();
    pca.set_idle(true);
    assert_eq!(pca.next_event(), NEVER);
    pca.sync(100 * COUNT);
    pca.set_idle(false);
    pca.sync(110 * COUNT);
    assert_eq!(count(&pca), 10);
}

#[test]
fn cidl_holds_the_watchdog_too_while_the_chip_sleeps() {
    let mut pca = Pca::new(1, 0);
    pca.write(sfr::PCA0MD, 0x00).unwrap();
    pca.write(sfr::PCA0MD, 0xC0).unwrap();
    pca.set_idle(true);
    assert_eq!(pca.next_event(), NEVER);
    pca.sync(9_996);
    pca.set_idle(false);
    assert_eq!(pca.next_event(), 9_996 + 256 * COUNT);
}

#[test]
fn the_longest_work_between_two_feedings_leaves_sleep_out_and_ends_where_the_watchdog_is_stopped() {
    let mut pca = running();
    pca.write(sfr::PCA0MD, 0x40).unwrap();
    for (sleeps_at, wakes_at, fed_at) in [(10, 90, 100), (105, 110, 130)] {
        pca.sync(sleeps_at * COUNT);
        pca.set_idle(true);
        pca.sync(wakes_at * COUNT);
        pca.set_idle(false);
        pca.sync(fed_at * COUNT);
        pca.write(sfr::PCA0CPH4, 0).unwrap();
    }
    // 100 counts of which 80 asleep; 30, 5 asleep
    assert_eq!(pca.longest_work(), 25 * COUNT);
    pca.sync(170 * COUNT);
    pca.write(sfr::PCA0MD, 0x00).unwrap();
    pca.sync(900 * COUNT);
    pca.write(sfr::PCA0MD, 0x40).unwrap();
    assert_eq!(pca.longest_work(), 40 * COUNT);
}

#[test]
fn other_clock_sources_are_refused() {
    let mut pca = running();
    assert!(pca.write(sfr::PCA0MD, 0x04).is_err());
}

#[test]
fn a_flag_that_goes_up_while_pca0cn_is_changed_is_lost_on_a_chip_that_loses_flags() {
    let wrap = 0x1_0000 * COUNT;
    for (loses_flags_until, until, kept) in [
        (0, wrap + 1, true),     // a sound chip
        (NEVER, wrap - 1, true), // the instruction ends before the wrap
        (NEVER, wrap, false),    // and here as it wraps
        (wrap, wrap, true),      // mended by then
        (NEVER, wrap + 2, false),
    ] {
        let mut pca = running();
        pca.loses_flags_until = loses_flags_until;
        pca.sync(wrap - 2);
        pca.change_control_until(until);
        pca.sync(wrap + 100);
        assert_eq!(pca.read(sfr::PCA0CN) & 0x80 != 0, kept, "{until}");
        assert_eq!(count(&pca), 100 / COUNT as u16);
    }
}

#[test]
fn an_edge_that_comes_while_pca0cn_is_changed_is_captured_but_its_flag_is_lost() {
    let mut pca = running();
    pca.loses_flags_until = NEVER;
    pca.write(sfr::PCA0CPM0, 0x31).unwrap();
    pca.change_control_until(2);
    pca.edge(0, true, 2);
    assert!(!pca.pending());
    pca.edge(0, false, 500 * COUNT);
    assert!(pca.pending());
    assert_eq!(pca.read(sfr::PCA0CPL0), 0xF4);
}
