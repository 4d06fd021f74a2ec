//! Tests of flash memory against the rules of the datasheet's chapter.

use super::*;
use rand::SeedableRng;

fn flash() -> Flash {
    Flash::new(Box::new([0xFF; FLASH_SIZE]), 1)
}

fn unlock(flash: &mut Flash, psctl: u8) {
    flash.write(sfr::FLKEY, 0xA5);
    flash.write(sfr::FLKEY, 0xF1);
    flash.write(sfr::PSCTL, psctl);
}

#[test]
fn a_write_clears_bits_and_only_an_erase_of_the_page_sets_them() {
    let mut flash = flash();
    for (value, expected) in [(0xF0, 0xF0), (0x3C, 0x30)] {
        unlock(&mut flash, PSWE);
        flash.movx(0xF400, value, true).unwrap();
        assert_eq!(flash.byte(0xF400), expected);
    }
    unlock(&mut flash, PSWE | PSEE);
    flash.movx(0xF5FF, 0, true).unwrap();
    assert_eq!(flash.byte(0xF400), 0xFF);
}

#[test]
fn an_operation_takes_any_time_within_the_datasheets_limits_by_the_seed() {
    let times_us = |seed, psctl| {
        let mut flash = Flash::new(Box::new([0xFF; FLASH_SIZE]), seed);
        (0..200)
            .map(|_| {
                unlock(&mut flash, psctl);
                let Operation::Done(stall) = flash.movx(0xF400, 0, true).unwrap() else { panic!("refused") };
                stall / TICKS_PER_US
            })
            .collect::<Vec<_>>()
    };
    for (psctl, shortest_us, longest_us) in [(PSWE, 40, 70), (PSWE | PSEE, 10_000, 20_000)] {
        let drawn_us = times_us(1, psctl);
        let (least_us, most_us) = (*drawn_us.iter().min().unwrap(), *drawn_us.iter().max().unwrap());
        // Of 200, the chance that none is within a twentieth of a limit is 0.95^200 = 4e-5.
        let margin_us = (longest_us - shortest_us) / 20 + 1;
        assert!((shortest_us..shortest_us + margin_us).contains(&least_us), "{least_us}");
        assert!((longest_us - margin_us..=longest_us).contains(&most_us), "{most_us}");
        assert_eq!(drawn_us, times_us(1, psctl));
        assert_ne!(drawn_us, times_us(2, psctl));
    }
}

#[test]
fn the_slowest_chip_takes_the_longest_that_the_datasheet_allows() {
    let mut flash = flash();
    flash.is_slowest = true;
    for (psctl, expected) in [(PSWE, 70 * TICKS_PER_US), (PSWE | PSEE, 20 * TICKS_PER_MS)] {
        unlock(&mut flash, psctl);
        assert_eq!(flash.movx(0xF400, 0, true).unwrap(), Operation::Done(expected));
    }
}

#[test]
fn every_operation_wants_its_own_keys() {
    let mut flash = flash();
    unlock(&mut flash, PSWE);
    flash.movx(0xF400, 0, true).unwrap();
    assert_eq!(flash.movx(0xF401, 0, true).unwrap(), Operation::Refused);
    assert_eq!(flash.byte(0xF401), 0xFF);
    unlock(&mut flash, PSWE);
    assert_eq!(flash.movx(0xF401, 0, true).unwrap(), Operation::Refused);
}

#[test]
fn a_wrong_key_locks_flash_until_the_next_reset() {
    let mut flash = flash();
    flash.write(sfr::FLKEY, 0xF1);
    assert_eq!(flash.read(sfr::FLKEY), 3);
    unlock(&mut flash, PSWE);
    assert_eq!(flash.movx(0xF400, 0, true).unwrap(), Operation::Refused);
    flash.reset();
    unlock(&mut flash, PSWE);
    assert!(matches!(flash.movx(0xF400, 0, true).unwrap(), Operation::Done(_)));
}

#[test]
fn a_write_without_the_supply_monitor_or_to_the_reserved_area_is_a_flash_error() {
    let mut flash = flash();
    unlock(&mut flash, PSWE);
    assert_eq!(flash.movx(0xF400, 0, false).unwrap(), Operation::FlashError);
    assert_eq!(flash.movx(RESERVED, 0, true).unwrap(), Operation::FlashError);
}

#[test]
fn a_memory_that_is_read_too_fast_gives_wrong_bits_until_it_is_not() {
    let mut flash = flash();
    flash.set_outrun(true);
    let wrong = (0..=0xFFFF).map(|address| flash.byte(address).count_zeros()).sum::<u32>();
    assert!((4_000..6_000).contains(&wrong), "{wrong} of 524288 bits");
    unlock(&mut flash, PSWE);
    flash.movx(0xF400, 0x0F, true).unwrap();
    assert_eq!(flash.bytes()[0xF400], 0x0F);
    flash.set_outrun(false);
    assert_eq!(flash.byte(0xF400), 0x0F);
    assert!((0..0xF400).all(|address| flash.byte(address) == 0xFF));
}

#[test]
fn a_write_cut_short_clears_some_of_its_bits_and_no_others() {
    let outcomes: Vec<u8> = (0..40)
        .map(|seed| {
            let mut flash = flash();
            unlock(&mut flash, PSWE);
            flash.movx(0xF400, 0x0F, true).unwrap();
            flash.interrupt(&mut ChaCha8Rng::seed_from_u64(seed));
            flash.byte(0xF400)
        })
        .collect();
    assert!(outcomes.iter().all(|byte| byte & 0x0F == 0x0F));
    assert!(outcomes.contains(&0x0F) && outcomes.contains(&0xFF));
    assert!(outcomes.iter().any(|byte| !matches!(byte, 0x0F | 0xFF)));
}

#[test]
fn the_page_of_the_lock_byte_is_refused_loudly() {
    let mut flash = flash();
    unlock(&mut flash, PSWE);
    assert!(flash.movx(0xFBFF, 0, true).is_err());
}
