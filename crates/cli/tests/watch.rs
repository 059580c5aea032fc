//! The estimate of a log while it is written, on a page of this computer.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{EXPERIMENT, Folder, VEHICLE, refused, wetclutch};

fn watch(log: &str, port: &str) -> Child {
    let serve = format!("--serve={port}");
    Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["watch", log, "--vehicle", VEHICLE, &serve])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// What is answered to a request of a path with this host, until the answer has a part or ends.
fn answer(address: &str, host: &str, path: &str, until: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    let (mut text, mut bytes) = (String::new(), [0; 4096]);
    while !text.contains(until) {
        match stream.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) => text += &String::from_utf8_lossy(&bytes[..count]),
            // A timeout makes a read of a socket end with the signals of others.
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
    text
}

#[test]
fn a_pipe_is_shown_on_a_page_until_it_ends_and_then_the_table_is_printed() {
    let folder = Folder::new("watch");
    wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]);
    let rows = folder.read("e1_measured.csv");
    let mut command = watch("-", "0");
    let mut said = BufReader::new(command.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("page: http://").and_then(|rest| rest.strip_suffix('/')).unwrap().to_owned();
    assert!(address.starts_with("127.0.0.1:"), "{address}");
    // The page is there before the first row.
    let page = answer(&address, &address, "/", "</html>");
    assert!(
        page.starts_with("HTTP/1.1 200 OK") && page.contains("Content-Security-Policy: default-src 'none'"),
        "{page}"
    );
    assert!(page.contains("<h1>standard input</h1>") && page.contains("EventSource"), "{page}");
    assert!(answer(&address, "evil.example", "/rows", "Forbidden").starts_with("HTTP/1.1 403"));
    let mut input = command.stdin.take().unwrap();
    let most = rows.len() * 9 / 10;
    input.write_all(&rows.as_bytes()[..most]).unwrap();
    let shown = answer(&address, &address, "/rows", "\"health\":\"");
    assert!(shown.contains("text/event-stream") && shown.contains("\"health\":\""), "{shown}");
    // A second command at the same port is refused, and does not disturb the first.
    let port = address.split_once(':').unwrap().1;
    let message = refused(&watch("-", port).wait_with_output().unwrap());
    assert!(
        message.contains(&format!("--serve: port {port} of 127.0.0.1: ")) && message.contains("hint: "),
        "{message}"
    );
    input.write_all(&rows.as_bytes()[most..]).unwrap();
    drop(input);
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    let output = command.wait_with_output().unwrap();
    assert!(output.status.success() && rest.contains("shifts: 1 "), "{rest}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("1-2"), "{:?}", output.stdout);
}

#[test]
fn a_growing_file_is_watched_until_an_interrupt() {
    let folder = Folder::new("watch_file");
    wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]);
    let (log, begin) = (folder.path("e1_measured.csv"), Instant::now());
    let mut command = watch(&log, "0");
    let mut said = BufReader::new(command.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().trim_start_matches("page: http://").trim_end_matches('/').to_owned();
    assert!(answer(&address, &address, "/rows", "\"samples\":[[").contains("\"samples\":[["));
    assert!(command.try_wait().unwrap().is_none());
    let interrupt = Command::new("kill").args(["-INT", &command.id().to_string()]).status().unwrap();
    assert!(interrupt.success());
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert!(command.wait().unwrap().success() && rest.contains("shifts: "), "{rest}");
    assert!(begin.elapsed() < Duration::from_secs(30));
}

#[test]
fn what_cannot_be_watched_is_refused_with_a_hint() {
    let message = refused(&wetclutch(&["watch", "-", "--vehicle", VEHICLE]));
    assert!(message.contains("no terminal to draw in\nhint: --serve"), "{message}");
    let message = refused(&wetclutch(&["watch", "none.csv", "--vehicle", VEHICLE, "--serve"]));
    assert!(message.contains("none.csv: "), "{message}");
    let message = refused(&wetclutch(&["watch", "none.csv", "--vehicle", "none.toml", "--serve"]));
    assert!(message.contains("none.toml: "), "{message}");
    let message = refused(&wetclutch(&["watch", "-", "--vehicle", VEHICLE, "--window", "0"]));
    assert!(message.contains("expected a number from 1 to 600"), "{message}");
}
