//! The model: the observer of a car, its inputs and its last estimate.

use alloc::vec::Vec;
use core::ffi::CStr;

use ecu::{ESTIMATE_WORDS, Estimate, INPUT_WORDS, Input, OwnedObserver, crc32};

use crate::instance::{Done, Simulated};
use crate::system::read_words;

/// First reference of the words of the input, and of the estimate.
pub(crate) const INPUTS: u32 = 1000;
/// See [`INPUTS`].
pub(crate) const ESTIMATES: u32 = 2000;
/// Place of the checksum among the words of an image.
const CHECKSUM_AT: usize = 3;

const NO_FILE: &CStr = c"resources/parameters.bin cannot be read";
const NO_IMAGE: &CStr =
    c"resources/parameters.bin is damaged, or of another version of wetclutch: export the model again";
const OTHER_TOKEN: &CStr =
    c"resources/parameters.bin is not that of the model description: its guid or instantiationToken names another one";
const NOT_OF_THIS: &CStr = c"the bytes are no state of this model, or damaged";

/// What changes in a simulation.
#[derive(Clone)]
pub(crate) struct Run {
    observer: OwnedObserver,
    input: Input,
    estimate: Estimate,
    /// Length of the step before, s.
    before_s: Option<f32>,
}

/// The observer of a car.
pub(crate) struct ObserverModel {
    image: Vec<u32>,
    run: Run,
}

impl Run {
    fn new(image: &[u32]) -> Done<Self> {
        let observer = OwnedObserver::new(image).map_err(|_| NO_IMAGE)?;
        let estimate = Estimate { gear_from: -1, gear_to: -1, phase: -1, ..Estimate::default() };
        Ok(Self { observer, input: Input::usual(), estimate, before_s: None })
    }

    /// The word of a variable, and whether it is a real number.
    fn word(&self, reference: u32) -> Option<(u32, bool)> {
        if let Some(at) = reference.checked_sub(ESTIMATES) {
            let at = at as usize;
            return Some((*self.estimate.words().get(at)?, Estimate::is_real(at)));
        }
        let at = place_of_input(reference)?;
        Some((*self.input.words().get(at)?, Input::is_real(at)))
    }

    /// Sets the word of an input of this kind.
    fn set(&mut self, reference: u32, is_real: bool, word: u32) -> Option<()> {
        let at = place_of_input(reference).filter(|at| Input::is_real(*at) == is_real)?;
        *self.input.words_mut().get_mut(at)? = word;
        Some(())
    }
}

/// The place of an input among the words. The first one, the time step, is that of the simulation.
fn place_of_input(reference: u32) -> Option<usize> {
    let at = reference.checked_sub(INPUTS)? as usize;
    (1..INPUT_WORDS).contains(&at).then_some(at)
}

impl Simulated for ObserverModel {
    type State = Run;

    fn new(resources: &[u8], token: &[u8]) -> Done<Self> {
        let path = [resources, b"/parameters.bin\0"].concat();
        let image = CStr::from_bytes_until_nul(&path).ok().and_then(read_words).ok_or(NO_FILE)?;
        let run = Run::new(&image)?;
        let digits = token.iter().filter_map(|c| char::from(*c).to_digit(16)).take(8);
        let named = digits.fold(0, |number, digit| 16 * number + digit);
        if image.get(CHECKSUM_AT) == Some(&named) { Ok(Self { image, run }) } else { Err(OTHER_TOKEN) }
    }

    fn reset(&mut self) -> Done {
        self.run = Run::new(&self.image)?;
        Ok(())
    }

    fn start(&mut self) -> Done {
        Ok(())
    }

    /// The inputs are those at the beginning of the step, so the time since the step before is the length of that one.
    fn step(&mut self, length_s: f64) -> Done {
        let length_s = length_s as f32;
        let run = &mut self.run;
        let input = Input { dt_s: run.before_s.unwrap_or(length_s), ..run.input };
        run.estimate = *run.observer.get().map_err(|_| NO_IMAGE)?.step(&input);
        run.before_s = Some(length_s);
        Ok(())
    }

    fn real(&self, reference: u32) -> Option<f64> {
        let (word, is_real) = self.run.word(reference)?;
        is_real.then_some(f64::from(f32::from_bits(word)))
    }

    fn set_real(&mut self, reference: u32, value: f64) -> Option<()> {
        self.run.set(reference, true, (value as f32).to_bits())
    }

    fn whole(&self, reference: u32) -> Option<i32> {
        let (word, is_real) = self.run.word(reference)?;
        (!is_real).then_some(word.cast_signed())
    }

    fn set_whole(&mut self, reference: u32, value: i32) -> Option<()> {
        self.run.set(reference, false, value.cast_unsigned())
    }

    fn state(&self) -> Done<Run> {
        Ok(self.run.clone())
    }

    fn restore(&mut self, state: &Run) {
        self.run = state.clone();
    }

    /// A checksum, that of the image, and the words of the run.
    fn serialised(&self, state: &Run) -> Done<Vec<u8>> {
        let memory = state.observer.memory().iter().flat_map(|word| [*word as u32, (word >> 32) as u32]);
        let head = [
            self.image.get(CHECKSUM_AT).copied().unwrap_or_default(),
            u32::from(state.before_s.is_some()),
            state.before_s.unwrap_or_default().to_bits(),
        ];
        let words = head.iter().chain(state.input.words()).chain(state.estimate.words()).copied();
        let words: Vec<u32> = words.chain(memory).collect();
        let checksum = crc32(words.iter().copied());
        Ok([checksum].iter().chain(&words).flat_map(|word| word.to_le_bytes()).collect())
    }

    fn deserialised(&self, bytes: &[u8]) -> Done<Run> {
        let words: Vec<u32> = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
        let take = || -> Option<Run> {
            let (checksum, words) = words.split_first()?;
            let (head, rest) = words.split_first_chunk::<3>()?;
            let (input, rest) = rest.split_first_chunk::<INPUT_WORDS>()?;
            let (estimate, memory) = rest.split_first_chunk::<ESTIMATE_WORDS>()?;
            if *checksum != crc32(words.iter().copied()) || self.image.get(CHECKSUM_AT) != head.first() {
                return None;
            }
            let mut run = self.run.clone();
            run.before_s = (head[1] == 1).then_some(f32::from_bits(head[2]));
            *run.input.words_mut() = *input;
            *run.estimate.words_mut() = *estimate;
            let memory: Vec<u64> =
                memory.as_chunks().0.iter().map(|[low, high]| u64::from(*low) | u64::from(*high) << 32).collect();
            // SAFETY: by the checksums it is the memory of an observer of this image.
            unsafe { run.observer.restore(&memory).then_some(run) }
        };
        take().ok_or(NOT_OF_THIS)
    }
}
