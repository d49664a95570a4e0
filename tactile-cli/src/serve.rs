//! `tactile stream --serve`: the running measurement, on a page for browsers.
use crate::failure::Failure;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use ndarray::{ArrayView3, Axis, Slice};
use serde_json::{Value, json};
use std::error::Error;
use std::io::Write;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tiny_http::{Header, Method, Request, Response, Server};

/// Maximum number of browsers at once. Each has a thread.
const MOST_VIEWERS: usize = 32;

/// Time between two pictures. A picture is most of an event, and more pictures would not be
/// visible.
const BETWEEN_PICTURES: Duration = Duration::from_millis(50);

/// Time between two surfaces and states of the sensor, which delay the measurement more than a
/// picture: full frames (1392 × 1042) lose less than 5 % of their rate.
const BETWEEN_SURFACES: Duration = Duration::from_millis(500);

/// Maximum number of columns of a picture, enough for a phone.
const PICTURE_COLUMNS: usize = 480;

/// The result of the last frame, which is replaced by the next, viewed or not.
#[derive(Default)]
struct Latest {
    number: u64,
    numbers: Value,
    /// Parts that change less often, each with its own number.
    picture: (u64, Value),
    surface: (u64, Value),
    ended: bool,
}

#[derive(Default)]
struct Shared {
    latest: Mutex<Latest>,
    changed: Condvar,
    viewers: AtomicUsize,
}

impl Shared {
    fn update(&self, change: impl FnOnce(&mut Latest)) {
        change(&mut self.latest.lock().unwrap_or_else(PoisonError::into_inner));
        self.changed.notify_all();
    }

    /// The next event after those numbers, as soon as there is one. `None` at the end.
    fn next(&self, seen: &mut [u64; 3]) -> Option<Value> {
        let latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        let waits = |latest: &mut Latest| latest.number == seen[0] && !latest.ended;
        let latest = self.changed.wait_while(latest, waits);
        let latest = latest.unwrap_or_else(PoisonError::into_inner);
        if latest.number == seen[0] {
            return None;
        }
        let mut event = latest.numbers.clone();
        let parts = [("picture", &latest.picture), ("surface", &latest.surface)];
        for ((name, (number, part)), seen) in parts.into_iter().zip(&mut seen[1..]) {
            if number != seen {
                event[name] = part.clone();
                *seen = *number;
            }
        }
        seen[0] = latest.number;
        Some(event)
    }
}

/// A server of the page. It never delays the measurement: viewers get the latest result, and
/// intermediate ones are dropped.
pub(crate) struct LivePage {
    shared: Arc<Shared>,
    /// Times of the last picture and the last surface.
    shown: [Option<Instant>; 2],
    /// Address of the page for a browser.
    pub url: String,
}

impl LivePage {
    /// Listens on an address. If other computers can reach it, the address of the page contains a
    /// token.
    pub(crate) fn serve(address: SocketAddr) -> Result<Self, Failure> {
        let refused = |error: Box<dyn Error + Send + Sync>| {
            Failure::input(format!("cannot serve on {address}: {error}"))
        };
        let listener = TcpListener::bind(address).map_err(|error| refused(error.into()))?;
        // Connections inherit the option. Without it, the end of a large event would wait about 40
        // ms until the browser acknowledges the rest.
        #[cfg(unix)]
        rustix::net::sockopt::set_tcp_nodelay(&listener, true).map_err(Failure::output)?;
        let server = Server::from_listener(listener, None).map_err(refused)?;
        let bound = server.server_addr().to_ip().unwrap_or(address);
        let token = match address.ip().is_loopback() {
            true => String::new(),
            false => {
                let mut bytes = [0; 16];
                getrandom::fill(&mut bytes).map_err(Failure::output)?;
                format!("{:032x}", u128::from_ne_bytes(bytes))
            }
        };
        let query = match token.as_str() {
            "" => String::new(),
            token => format!("?token={token}"),
        };
        let shared = Arc::<Shared>::default();
        let page = Self {
            shared: Arc::clone(&shared),
            shown: [None; 2],
            url: format!("http://{bound}/{query}"),
        };
        std::thread::spawn(move || {
            for request in server.incoming_requests() {
                answer(request, &query, &shared);
            }
        });
        Ok(page)
    }

    /// Shows the numbers of a frame of one or three channels, `[row, column, channel]`. Its picture
    /// and its surface are added if the last ones are old enough and there is a viewer.
    pub(crate) fn show(
        &mut self,
        numbers: Value,
        frame: ArrayView3<'_, u8>,
        surface: impl FnOnce() -> Value,
    ) {
        let watched = self.shared.viewers.load(Ordering::Relaxed) > 0;
        let waits = [BETWEEN_PICTURES, BETWEEN_SURFACES];
        let mut due = [false; 2];
        for ((due, shown), wait) in due.iter_mut().zip(&mut self.shown).zip(waits) {
            *due = watched && shown.is_none_or(|at| at.elapsed() >= wait);
            if *due {
                *shown = Some(Instant::now());
            }
        }
        let picture = due[0].then(|| picture(frame));
        let surface = due[1].then(surface);
        self.shared.update(|latest| {
            latest.number += 1;
            latest.numbers = numbers;
            let parts = [
                (&mut latest.picture, picture),
                (&mut latest.surface, surface),
            ];
            for ((number, part), new) in parts {
                if let Some(new) = new {
                    *number += 1;
                    *part = new;
                }
            }
        });
    }
}

/// A thinned frame.
fn picture(frame: ArrayView3<'_, u8>) -> Value {
    let (_, columns, channels) = frame.dim();
    let step = columns.div_ceil(PICTURE_COLUMNS).max(1);
    let every = Slice::new(0, None, step as isize);
    let rows = frame.slice_axis(Axis(0), every);
    let bytes: Vec<u8> = rows.slice_axis(Axis(1), every).iter().copied().collect();
    let width = columns.div_ceil(step);
    json!({ "width": width, "channels": channels, "levels": BASE64_STANDARD.encode(bytes) })
}

impl Drop for LivePage {
    fn drop(&mut self) {
        self.shared.update(|latest| latest.ended = true);
        // Viewers get the last result before the program ends and closes their connections.
        let start = Instant::now();
        while self.shared.viewers.load(Ordering::Relaxed) > 0 && start.elapsed().as_millis() < 200 {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// Responds with the page or with events. No path leads to a file.
fn answer(request: Request, query: &str, shared: &Arc<Shared>) {
    let header = |name: &'static str| {
        let mut headers = request.headers().iter();
        let found = headers.find(|header| header.field.equiv(name));
        found.map_or("", |header| header.value.as_str())
    };
    let page = format!("/{query}");
    let events = format!("/events{query}");
    // A page of another site may resolve its own name to this address, but cannot forge a numeric
    // host.
    let status = if !is_address(header("Host")) {
        403
    } else if *request.method() != Method::Get {
        405
    } else if request.url() == page {
        200
    } else if request.url() != events {
        // A wrong token gives the same response as a wrong path.
        404
    } else if shared.viewers.fetch_add(1, Ordering::Relaxed) < MOST_VIEWERS {
        let shared = Arc::clone(shared);
        std::thread::spawn(move || {
            // Writing ends when a viewer leaves.
            let _ = send_events(request, &shared);
            shared.viewers.fetch_sub(1, Ordering::Relaxed);
        });
        return;
    } else {
        shared.viewers.fetch_sub(1, Ordering::Relaxed);
        503
    };
    let body = match status {
        200 => PAGE.replace("/* relief.js */", RELIEF),
        _ => String::new(),
    };
    let mut response = Response::from_string(body).with_status_code(status);
    for (name, value) in HEADERS {
        if let Ok(header) = Header::from_bytes(name, value) {
            response.add_header(header);
        }
    }
    // A viewer that has left is ignored.
    let _ = request.respond(response);
}

/// Whether a `Host` is a numeric address or this computer, with or without a port.
fn is_address(host: &str) -> bool {
    let with_port = host.rsplit_once(':');
    let with_port = with_port.filter(|(_, port)| port.parse::<u16>().is_ok());
    let name = with_port.map_or(host, |(name, _)| name);
    name == "localhost" || name.trim_matches(['[', ']']).parse::<IpAddr>().is_ok()
}

const HEADERS: [(&str, &str); 5] = [
    ("Content-Type", "text/html; charset=utf-8"),
    ("Cache-Control", "no-store"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    (
        "Content-Security-Policy",
        "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src \
         'self'; img-src data:; frame-ancestors 'none'",
    ),
];

fn send_events(request: Request, shared: &Shared) -> std::io::Result<()> {
    let mut output = request.into_writer();
    let head = "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: \
                no-store\r\nConnection: close\r\n\r\n";
    output.write_all(head.as_bytes())?;
    let mut seen = [0; 3];
    while let Some(event) = shared.next(&mut seen) {
        write!(output, "data: {event}\n\n")?;
        output.flush()?;
    }
    output.write_all(b"event: end\ndata: {}\n\n")?;
    output.flush()
}

const PAGE: &str = include_str!("serve.html");

/// Replaces its name in the page.
const RELIEF: &str = include_str!("relief.js");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_numbers_and_this_computer_are_hosts() {
        for host in [
            "127.0.0.1:80",
            "127.0.0.1",
            "localhost:8642",
            "[::1]:80",
            "[::1]",
            "10.0.0.7:1",
        ] {
            assert!(is_address(host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "evil.example:80",
            "127.0.0.1.evil.example",
            "localhost.evil:80",
        ] {
            assert!(!is_address(host), "{host}");
        }
    }

    #[test]
    fn a_slow_viewer_gets_the_latest() {
        let shared = Shared::default();
        for k in 1..=5 {
            shared.update(|latest| {
                latest.number = k;
                latest.numbers = json!({ "frame": k });
            });
        }
        let mut seen = [0; 3];
        assert_eq!(shared.next(&mut seen), Some(json!({ "frame": 5 })));
        shared.update(|latest| latest.ended = true);
        assert_eq!(shared.next(&mut seen), None);
    }
}
