//! What reaches a sensor besides its own echo: what is left of its last ping, and the bursts of others.

use super::air::{Air, Arrival};
use crate::room::acoustics::{Look, Scene};
use crate::time::{NEVER, Oscillator, Tick, from_seconds};
use std::collections::VecDeque;
use std::rc::Rc;

pub struct Hearing {
    scene: Rc<Scene>,
    /// The air that this unit shares with others, and its number among them.
    shared: Option<(Rc<Air>, usize)>,
    /// The unit's, by which it tells times; in the air they are shared ones.
    oscillator: Oscillator,
    /// When the last ping was sent, and how the sensor looked then.
    last_ping: Option<(Tick, Look)>,
    /// What is left of the ping before that, soonest first.
    reverberation: VecDeque<Arrival>,
}

impl Hearing {
    pub fn new(scene: Rc<Scene>, shared: Option<(Rc<Air>, usize)>, oscillator: Oscillator) -> Self {
        Self { scene, shared, oscillator, last_ping: None, reverberation: VecDeque::new() }
    }

    /// The sensor sends a ping, of which flights are counted from `sent_at`.
    pub fn ping(&mut self, look: Look, sent_at: Tick) {
        self.reverberation = self.reverberation_from(sent_at);
        if let Some((air, index)) = &self.shared {
            air.burst(*index, &look, self.oscillator.shared(sent_at));
        }
        self.last_ping = Some((sent_at, look));
    }

    /// When the next sound arrives.
    pub fn next_arrival(&self) -> Tick {
        let own = self.reverberation.front().map_or(NEVER, |arrival| arrival.at);
        let of_others = self.shared.as_ref().map_or(NEVER, |(air, index)| air.next_arrival(*index));
        self.oscillator.own(of_others).min(own)
    }

    /// What has arrived by `now`, one at a time and in order.
    pub fn take(&mut self, now: Tick) -> Option<Arrival> {
        let next = self.next_arrival();
        if next > now {
            return None;
        }
        match self.reverberation.front() {
            Some(own) if own.at == next => self.reverberation.pop_front(),
            _ => {
                let (air, index) = self.shared.as_ref()?;
                let arrival = air.take(*index, self.oscillator.shared(now))?;
                Some(Arrival { at: self.oscillator.own(arrival.at), ..arrival })
            }
        }
    }

    /// What is yet to come of the last ping after `sent_at`; of those before it nothing is left. Assumed.
    fn reverberation_from(&self, sent_at: Tick) -> VecDeque<Arrival> {
        let room = self.scene.room();
        let lasts_s = room.sensor.reverberation_ms / 1e3;
        let Some((last_at, look)) = self.last_ping.filter(|(at, _)| sent_at < at + from_seconds(lasts_s))
        else {
            return VecDeque::new();
        };
        let speed_m_s = room.speed_of_sound(look.at_s);
        let echoes = self.scene.reverberation(&look, lasts_s * speed_m_s);
        let arrivals = echoes.into_iter().map(|echo| Arrival {
            at: last_at + self.oscillator.own(from_seconds(2.0 * echo.range_m / speed_m_s)),
            from_rad: echo.from_rad,
            range_m: echo.range_m,
            chance: echo.chance,
            of_another: false,
        });
        arrivals.filter(|arrival| arrival.at > sent_at).collect()
    }
}
