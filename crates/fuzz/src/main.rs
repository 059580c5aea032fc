//! Runs fuzz cases for a given time.
//!
//! ```text
//! cargo run --release -p fuzz -- --seconds 600 [--target NAME] [--first CASE]
//! cargo run --release -p fuzz -- --target NAME --replay FILE
//! ```

#![expect(clippy::print_stdout, reason = "it is a program for those who work on the project")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use std::{env, fs, process, thread};

use fuzz::{Depth, Fuzzer, Target};

/// Cases of a target before it is the next one's turn.
const TURN: u64 = 20;
/// Findings after which a target is left alone: most are the same one again.
const ENOUGH: usize = 5;
/// A case that takes longer will not end.
const LONGEST: Duration = Duration::from_secs(60);

struct Arguments {
    seconds: u64,
    targets: Vec<Target>,
    first: u64,
    replay: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut arguments = Arguments { seconds: 60, targets: Target::ALL.to_vec(), first: 0, replay: None };
    let mut words = env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words.next().ok_or_else(|| format!("{word} needs a value"))?;
        match word.as_str() {
            "--seconds" => arguments.seconds = value.parse()?,
            "--first" => arguments.first = value.parse()?,
            "--replay" => arguments.replay = Some(value.into()),
            "--target" => arguments.targets.retain(|target| target.name() == value),
            _ => return Err(format!("{word} is none of --seconds, --target, --first, --replay").into()),
        }
    }
    if arguments.targets.is_empty() {
        let names = Target::ALL.map(Target::name).join(", ");
        return Err(format!("there is no such target\nhint: the targets are {names}").into());
    }
    Ok(arguments)
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let arguments = arguments()?;
    let fuzzer = Fuzzer::new(Depth::Long)?;
    if let Some(path) = &arguments.replay {
        let [target] = arguments.targets[..] else { return Err("--replay needs a --target".into()) };
        fuzzer.run(target, &fs::read(path)?);
        println!("{} takes {}", target.name(), path.display());
        return Ok(ExitCode::SUCCESS);
    }
    let now = watched();
    let mut findings = 0;
    let mut turns: Vec<Turn> = arguments.targets.iter().map(|&target| Turn::new(target, arguments.first)).collect();
    let end = Instant::now() + Duration::from_secs(arguments.seconds);
    while Instant::now() < end && turns.iter().any(|turn| turn.findings < ENOUGH) {
        for turn in turns.iter_mut().filter(|turn| turn.findings < ENOUGH) {
            turn.take(&fuzzer, &now)?;
        }
    }
    for Turn { target, next, findings: found, slowest: (time, case) } in &turns {
        let (cases, name) = (next - arguments.first, target.name());
        println!("{name}: {cases} cases, {found} findings; case {case} took longest, {:.3} s", time.as_secs_f64());
        findings += found;
    }
    Ok(if findings == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A case under way, with its beginning.
type Now = Arc<Mutex<Option<(Instant, Target, u64, Vec<u8>)>>>;

/// Where to say what is under way: a thread ends the program when that takes too long.
fn watched() -> Now {
    let now = Now::default();
    let watch = Arc::clone(&now);
    thread::spawn(move || {
        loop {
            thread::sleep(LONGEST / 10);
            let under_way = watch.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((start, target, case, input)) = &*under_way
                && start.elapsed() > LONGEST
            {
                if let Err(error) = keep(*target, *case, input, "does not end") {
                    println!("{error}");
                }
                process::exit(1);
            }
        }
    });
    now
}

/// Writes the input of a finding and says how to try it again.
fn keep(target: Target, case: u64, input: &[u8], what: &str) -> Result<(), Box<dyn Error>> {
    let (name, folder) = (target.name(), Path::new("target/fuzz"));
    let path = folder.join(format!("{name}-{case}"));
    fs::create_dir_all(folder)?;
    fs::write(&path, input)?;
    println!("{name}: case {case} {what}; again with --target {name} --replay {}", path.display());
    Ok(())
}

/// Where a target stands.
struct Turn {
    target: Target,
    next: u64,
    findings: usize,
    slowest: (Duration, u64),
}

impl Turn {
    fn new(target: Target, first: u64) -> Self {
        Self { target, next: first, findings: 0, slowest: (Duration::ZERO, first) }
    }

    /// A few cases. The message of a panic stands on standard error.
    fn take(&mut self, fuzzer: &Fuzzer, now: &Now) -> Result<(), Box<dyn Error>> {
        for case in self.next..self.next + TURN {
            let input = fuzzer.input(self.target, case);
            let start = Instant::now();
            *now.lock().unwrap_or_else(PoisonError::into_inner) = Some((start, self.target, case, input.clone()));
            let survived = fuzzer.survives(self.target, &input);
            self.slowest = self.slowest.max((start.elapsed(), case));
            if !survived {
                self.findings += 1;
                keep(self.target, case, &input, "panics")?;
            }
        }
        self.next += TURN;
        Ok(())
    }
}
