//! Which torque balances of driving between shifts are fitted, and why the others are not.

use crate::driving::{Balance, DrivenCar, Driving, Usable, misfit, usable};

/// The balances of car and engine, each used or left out for a reason.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Balances([Result<(), String>; 2]);

impl Balances {
    pub(crate) fn of(car: &DrivenCar, driving: &Driving) -> Self {
        let Usable { car, engine } = usable(car, driving);
        Self([car, engine])
    }

    /// Whether those of car and engine are fitted.
    pub(crate) fn used(&self) -> [bool; 2] {
        self.0.each_ref().map(Result::is_ok)
    }

    /// Why a balance is not fitted.
    pub(crate) fn reason(&self, balance: Balance) -> Option<&str> {
        self.0[balance as usize].as_ref().err().map(String::as_str)
    }

    /// Leaves out what does not fit, by the scales of its errors; whether there is such a balance.
    pub(crate) fn leave_out(&mut self, scales: [f64; 2]) -> bool {
        let names = ["car", "engine"];
        let mut is_any = false;
        for ((balance, scale), name) in self.0.iter_mut().zip(scales).zip(names) {
            if let (Ok(()), Some(reason)) = (&balance, misfit(name, scale)) {
                *balance = Err(reason);
                is_any = true;
            }
        }
        is_any
    }
}
