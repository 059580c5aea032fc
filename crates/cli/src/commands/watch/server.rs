//! The page of the estimate, for browsers on this computer: bound to 127.0.0.1, read-only, and for no other site.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::{self, Scope};
use std::time::Duration;

use serde_json::{Value as Json, json};

use super::REDRAWN;
use super::view::{self, CURVES, PANELS, State, Value, View};
use crate::failure::Failure;

/// Browsers that look at the same time, at most.
const MAX_LOOKING: usize = 16;
/// Bytes of a request that are read.
const MAX_REQUEST: u64 = 16 << 10;
/// How long a browser may take for a request, or to take a part of an answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// Pictures between two lines without news: a browser that has gone is noticed by them.
const PICTURES_TO_A_SIGN: u32 = 20;

/// What the page may do: nothing but run its own script and ask this server.
const SECURITY: &str = "Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\nX-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\nCache-Control: no-store\r\n";

pub(super) struct Server {
    listener: TcpListener,
    address: SocketAddr,
    looking: AtomicUsize,
}

/// What a browser asks for.
#[derive(Debug, PartialEq)]
enum Request {
    Page,
    Rows,
    /// Something else, with the answer.
    Refused(&'static str),
}

impl Server {
    /// Listens at a port of 127.0.0.1; 0 is one that is free.
    pub(super) fn open(port: u16) -> Result<Self, Failure> {
        let failed = |error: io::Error| {
            Failure::Input(format!(
                "--serve: port {port} of 127.0.0.1: {error}\nhint: choose another port, or none for one that is free"
            ))
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self { listener, address, looking: AtomicUsize::new(0) })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers browsers until the estimate has ended.
    pub(super) fn serve<'scope, 'env>(
        &'env self,
        scope: &'scope Scope<'scope, 'env>,
        title: &'env str,
        view: &'env View,
        has_ended: &'env AtomicBool,
    ) {
        while !has_ended.load(Ordering::Relaxed) {
            match self.listener.accept() {
                Ok((stream, _)) if self.looking.load(Ordering::Relaxed) < MAX_LOOKING => {
                    self.looking.fetch_add(1, Ordering::Relaxed);
                    scope.spawn(move || {
                        // A browser that goes away is none of the estimate's errors.
                        let _ = self.answer(stream, title, view, has_ended);
                        self.looking.fetch_sub(1, Ordering::Relaxed);
                    });
                }
                Ok(_) => {}
                Err(_) => thread::sleep(REDRAWN),
            }
        }
    }

    fn answer(&self, mut stream: TcpStream, title: &str, view: &View, has_ended: &AtomicBool) -> io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        match request(BufReader::new(stream.try_clone()?.take(MAX_REQUEST)), self.address.port())? {
            Request::Page => {
                let page = page(title, view.window_s)?;
                write!(
                    stream,
                    "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\nContent-Length: {}\r\nConnection: close\r\n{SECURITY}\r\n{page}",
                    page.len()
                )
            }
            Request::Rows => {
                write!(
                    stream,
                    "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nConnection: close\r\n{SECURITY}\r\n"
                )?;
                rows(&mut stream, view, has_ended)
            }
            Request::Refused(answer) => write!(
                stream,
                "HTTP/1.1 {answer}\r\nContent-Type: text/plain\r\nContent-Length: {}\r\nConnection: close\r\n{SECURITY}\r\n{answer}",
                answer.len()
            ),
        }
    }
}

/// Reads a request. One of another site, or by another name of this computer, is refused.
fn request(mut lines: impl BufRead, port: u16) -> io::Result<Request> {
    let mut line = String::new();
    let mut next = |line: &mut String| {
        line.clear();
        lines.read_line(line).map(|_| ())
    };
    next(&mut line)?;
    let mut words = line.split_whitespace();
    let (method, path) = (words.next().unwrap_or_default().to_owned(), words.next().unwrap_or_default().to_owned());
    let (mut host, mut is_of_other_site) = (None, false);
    let own = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}"));
    loop {
        next(&mut line)?;
        let Some((name, value)) = line.trim_end().split_once(':') else { break };
        let value = value.trim();
        match name.to_ascii_lowercase().as_str() {
            "host" => host = Some(value.to_owned()),
            "origin" => is_of_other_site |= !own.iter().any(|own| value.strip_prefix("http://") == Some(own)),
            "sec-fetch-site" => is_of_other_site |= !["same-origin", "none"].contains(&value),
            _ => {}
        }
    }
    let is_own = host.is_some_and(|host| own.contains(&host));
    Ok(match (method.as_str(), path.as_str()) {
        _ if !is_own || is_of_other_site => Request::Refused("403 Forbidden"),
        ("GET", "/") => Request::Page,
        ("GET", "/rows") => Request::Rows,
        ("GET", _) => Request::Refused("404 Not Found"),
        _ => Request::Refused("405 Method Not Allowed"),
    })
}

/// Sends the rows as they come, as events, until the estimate ends or the browser goes.
fn rows(stream: &mut TcpStream, view: &View, has_ended: &AtomicBool) -> io::Result<()> {
    let (mut sent, mut pictures) = (0_u64, 0_u32);
    loop {
        let ended = has_ended.load(Ordering::Relaxed);
        let news = view.with(|state| {
            let end = state.dropped + state.samples.len() as u64;
            let news = (end > sent || ended).then(|| news(state, sent));
            sent = end;
            news
        });
        match news.flatten() {
            Some(news) => write!(stream, "data: {news}\n\n")?,
            None if pictures.is_multiple_of(PICTURES_TO_A_SIGN) => write!(stream, ":\n\n")?,
            None => {}
        }
        if ended {
            return write!(stream, "event: end\ndata: {{}}\n\n");
        }
        pictures = pictures.wrapping_add(1);
        thread::sleep(REDRAWN);
    }
}

/// What came after the samples that were `sent`.
fn news(state: &State, sent: u64) -> Json {
    let known = usize::try_from(sent.saturating_sub(state.dropped)).unwrap_or(usize::MAX);
    let samples: Vec<Json> = (state.samples.iter().skip(known))
        .map(|sample| {
            let values = sample.values.iter().flat_map(|Value { value, range: [low, high] }| [value, low, high]);
            std::iter::once(json!(rounded(sample.time_s - state.origin_s)))
                .chain(values.map(|value| rounded(*value)))
                .collect()
        })
        .collect();
    let words: serde_json::Map<String, Json> = ["gear", "target_gear", "phase", "offgoing", "oncoming", "health"]
        .into_iter()
        .filter(|column| state.has(column))
        .map(|column| (column.to_owned(), json!(state.word(column))))
        .collect();
    let elements: Vec<Json> = (state.elements().into_iter())
        .map(|(name, value)| json!([name, rounded(value.value), rounded(value.range[0]), rounded(value.range[1])]))
        .collect();
    let shifts: Vec<Json> = (state.shifts.iter().rev())
        .map(|shift| {
            let time_s = shift.end_s.map(|end_s| rounded(end_s - shift.begin_s));
            json!([shift.number, shift.gears, rounded(shift.begin_s - state.origin_s), time_s, shift.health])
        })
        .collect();
    json!({ "samples": samples, "words": words, "elements": elements, "shifts": shifts, "rate": state.rate().map(rounded) })
}

/// A number with as many digits as a figure shows; null where there is none.
fn rounded(value: f64) -> Json {
    if value.is_finite() {
        format!("{value:.4}").parse::<f64>().map_or(Json::Null, |value| json!(value))
    } else {
        Json::Null
    }
}

/// The page.
fn page(title: &str, window_s: f64) -> io::Result<String> {
    let panels: Vec<Json> = (PANELS.iter().enumerate())
        .map(|(panel, of)| {
            let curves = CURVES.iter().enumerate().filter(|(_, curve)| curve.panel == panel);
            let curves: Vec<Json> = curves.map(|(at, curve)| json!({ "name": curve.name, "at": at })).collect();
            json!({ "label": view::label(panel), "decimals": of.decimals, "curves": curves })
        })
        .collect();
    report::live_page(title, &json!({ "panels": panels, "window": window_s }).to_string()).map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(text: &str) -> Request {
        request(text.as_bytes(), 80).unwrap()
    }

    #[test]
    fn requests_of_other_sites_names_and_kinds_are_refused() {
        let host = "Host: 127.0.0.1:80\r\n";
        assert_eq!(asked(&format!("GET / HTTP/1.1\r\n{host}\r\n")), Request::Page);
        assert_eq!(
            asked("GET /rows HTTP/1.1\r\nhost: localhost:80\r\nOrigin: http://localhost:80\r\n\r\n"),
            Request::Rows
        );
        let forbidden = Request::Refused("403 Forbidden");
        for other in [
            "GET / HTTP/1.1\r\n\r\n".to_owned(),
            "GET / HTTP/1.1\r\nHost: evil.example:80\r\n\r\n".to_owned(),
            "GET / HTTP/1.1\r\nHost: 127.0.0.1:81\r\n\r\n".to_owned(),
            format!("GET /rows HTTP/1.1\r\n{host}Origin: http://evil.example\r\n\r\n"),
            format!("GET /rows HTTP/1.1\r\n{host}Origin: null\r\n\r\n"),
            format!("GET /rows HTTP/1.1\r\n{host}Sec-Fetch-Site: cross-site\r\n\r\n"),
            String::new(),
            "\u{0}\u{1}".to_owned(),
        ] {
            assert_eq!(asked(&other), forbidden, "{other:?}");
        }
        assert_eq!(asked(&format!("POST / HTTP/1.1\r\n{host}\r\n")), Request::Refused("405 Method Not Allowed"));
        assert_eq!(asked(&format!("GET /../etc/passwd HTTP/1.1\r\n{host}\r\n")), Request::Refused("404 Not Found"));
    }
}
