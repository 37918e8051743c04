//! A real HTTP server on this machine that serves one content, well or badly.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// How it serves.
#[derive(Clone, Copy, PartialEq)]
pub enum Manner {
    Well,
    /// Whatever range is asked for, the whole is sent.
    IgnoresRange,
    /// Announces all that was asked for, sends this many bytes of it and hangs up.
    CutsAfter(usize),
    /// Answers with this status and a page.
    Status(u16),
    /// Sends to the end without saying where that is.
    WithoutLength,
    /// First another address, then well.
    Redirects,
    /// Sends half of the content, and then nothing, and stays.
    Stalls,
    /// Sends a byte now and then.
    Trickles,
    /// Takes the request, and stays.
    SaysNothing,
}

pub struct Server {
    pub url: String,
    /// The `Range` of each request, in order; empty where there was none.
    ranges: Arc<Mutex<Vec<String>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    pub fn start(content: &[u8], manner: Manner) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("bound");
        let (ranges, stop) = (Arc::default(), Arc::new(AtomicBool::new(false)));
        let (seen, stopped, content) = (Arc::clone(&ranges), Arc::clone(&stop), content.to_vec());
        let serve = move || {
            for connection in listener.incoming() {
                if stopped.load(Ordering::SeqCst) {
                    return;
                }
                // A client may hang up whenever it likes.
                let _ = connection.and_then(|c| answer(c, &content, manner, &seen));
            }
        };
        Self { url: format!("http://{address}"), ranges, stop, thread: Some(std::thread::spawn(serve)) }
    }

    /// The `Range` of each request so far.
    pub fn ranges(&self) -> Vec<String> {
        self.ranges.lock().expect("no panic").clone()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        let _ = TcpStream::connect(self.url.trim_start_matches("http://"));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn answer(mut connection: TcpStream, content: &[u8], manner: Manner, seen: &Mutex<Vec<String>>) -> std::io::Result<()> {
    let mut lines = BufReader::new(connection.try_clone()?).lines();
    let request = lines.next().transpose()?.unwrap_or_default();
    let mut range = String::new();
    for line in lines {
        let line = line?;
        if line.is_empty() {
            break;
        }
        if let Some(value) = line.to_ascii_lowercase().strip_prefix("range:") {
            range = value.trim().to_owned();
        }
    }
    let from: usize = range.strip_prefix("bytes=").and_then(|r| r.trim_end_matches('-').parse().ok()).unwrap_or(0);
    seen.lock().expect("no panic").push(range);
    let whole = content.len();
    let (head, body) = match manner {
        Manner::Status(status) => (format!("{status} No\r\nContent-Length: 4"), &b"page"[..]),
        Manner::Redirects if !request.contains("/elsewhere") => {
            ("302 Found\r\nLocation: /elsewhere\r\nContent-Length: 0".to_owned(), &content[..0])
        }
        Manner::WithoutLength => ("200 OK".to_owned(), content),
        Manner::IgnoresRange => (format!("200 OK\r\nContent-Length: {whole}"), content),
        _ if from >= whole && from > 0 => {
            (format!("416 Range Not Satisfiable\r\nContent-Range: bytes */{whole}\r\nContent-Length: 0"), &content[..0])
        }
        _ => {
            let body = &content[from..];
            let status = if from > 0 { "206 Partial Content" } else { "200 OK" };
            let place =
                if from > 0 { format!("Content-Range: bytes {from}-{}/{whole}\r\n", whole - 1) } else { String::new() };
            (format!("{status}\r\n{place}Content-Length: {}", body.len()), body)
        }
    };
    let stay = || std::thread::sleep(std::time::Duration::from_secs(4));
    if manner == Manner::SaysNothing {
        stay();
        return Ok(());
    }
    let body = if let Manner::CutsAfter(n) = manner { &body[..n.min(body.len())] } else { body };
    write!(connection, "HTTP/1.1 {head}\r\nConnection: close\r\n\r\n")?;
    match manner {
        Manner::Stalls => {
            connection.write_all(&body[..body.len() / 2])?;
            stay();
            return Ok(());
        }
        Manner::Trickles => {
            for byte in body.iter().take(100) {
                connection.write_all(&[*byte])?;
                std::thread::sleep(std::time::Duration::from_millis(50));
            }
            return Ok(());
        }
        _ => {}
    }
    connection.write_all(body)
}
