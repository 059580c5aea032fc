//! `wetclutch watch`: the estimate of a log while it is written, in the terminal and on a page of this computer.

mod screen;
mod server;
mod view;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use console::Term;
use trace::ShownPath as _;

use self::screen::Screen;
use self::server::Server;
use self::view::View;
use super::estimate::{Messages, live, print_json};
use crate::args::Watch;
use crate::browser;
use crate::failure::Failure;
use crate::output;
use crate::signals::stop_then_end;

/// Time between two pictures.
const REDRAWN: Duration = Duration::from_millis(50);

pub(crate) fn watch(options: &Watch) -> Result<(), Failure> {
    let terminal = Term::stdout();
    let draws = terminal.is_term() && !options.json;
    if !draws && !options.json && options.serve.is_none() {
        let message = "standard output is no terminal to draw in\nhint: --serve shows the estimate on a page, `wetclutch estimate --follow` writes it";
        return Err(Failure::Input(message.to_owned()));
    }
    let server = options.serve.map(|port| Server::open(port.unwrap_or(0))).transpose()?;
    let address = server.as_ref().map(|server| format!("http://{}/", server.address()));
    if let Some(address) = &address {
        output::note(&format!("page: {address}"));
        browser::open_address_if(options.open, address);
    }
    let stop = Arc::new(AtomicBool::new(false));
    stop_then_end(&stop)?;
    let (arguments, view) = (options.estimate(), View::new(options.window));
    let title = options.log.shown().to_string();
    let (mut messages, has_ended) = (Messages::held(), AtomicBool::new(false));
    let result = thread::scope(|scope| {
        if let Some(server) = &server {
            scope.spawn(|| server.serve(scope, &title, &view, &has_ended));
        }
        if draws {
            scope.spawn(|| {
                let mut screen = Screen::new(terminal, &title, address.as_deref());
                while !has_ended.load(Ordering::Relaxed) {
                    thread::sleep(REDRAWN);
                    // A terminal that stands still holds up neither the estimate nor the page.
                    if let Some(lines) = view.with(|state| screen.lines(state)) {
                        screen.draw(&lines);
                    }
                }
            });
        }
        let _ending = Ending(&has_ended);
        live(&arguments, (&view, &stop), &mut messages)
    });
    let found = messages.result.take();
    let shown = messages.show(&options.log);
    result.and(shown)?;
    print_json(&arguments, found.into_iter().collect())
}

/// Ends what shows an estimate when the estimate ends, in whatever way.
struct Ending<'a>(&'a AtomicBool);

impl Drop for Ending<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
