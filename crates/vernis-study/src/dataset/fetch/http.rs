//! Reading a file over http or https, from its beginning or from where an earlier try ended.

use super::Stream;
use super::address::without_password;
use std::time::Duration;
use ureq::http::{Response, StatusCode};
use ureq::{Agent, Body};

const TO_CONNECT: Duration = Duration::from_secs(20);
const TO_ANSWER: Duration = Duration::from_secs(30);
/// Between two pieces of the content.
const TO_GO_ON: Duration = Duration::from_secs(30);

/// The content at `url` from byte `from` on, or from its beginning where the server cannot do that; all of it, to the last byte,
/// within the time `left`.
///
/// # Errors
/// Why the server could not be asked, or what it said.
pub(super) fn open(url: &str, from: u64, left: Duration) -> Result<Stream, String> {
    let agent: Agent = Agent::config_builder()
        .http_status_as_error(false)
        .user_agent(concat!("vernis/", env!("CARGO_PKG_VERSION")))
        .timeout_global(Some(left))
        .timeout_connect(Some(TO_CONNECT))
        .timeout_recv_response(Some(TO_ANSWER))
        .timeout_per_read(Some(TO_GO_ON))
        .build()
        .into();
    let request = agent.get(url);
    let request = if from > 0 { request.header("Range", format!("bytes={from}-")) } else { request };
    // What goes wrong may be told with the address as it was given.
    let response = request.call().map_err(|e| e.to_string().replace(url, &without_password(url)))?;
    match response.status() {
        StatusCode::OK => Ok(stream(0, response.body().content_length(), response)),
        StatusCode::PARTIAL_CONTENT => {
            let (start, whole) = content_range(&response).ok_or("the answer has no valid Content-Range")?;
            Ok(stream(start, whole, response))
        }
        // What is here already is no beginning of what is there.
        StatusCode::RANGE_NOT_SATISFIABLE if from > 0 => open(url, 0, left),
        status => Err(format!("the server answers {status}")),
    }
}

fn stream(start: u64, whole: Option<u64>, response: Response<Body>) -> Stream {
    Stream { start, whole, bytes: Box::new(response.into_body().into_reader()) }
}

/// The first byte and the size of the whole of `bytes FIRST-LAST/WHOLE` (RFC 9110, section 14.4).
fn content_range(response: &Response<Body>) -> Option<(u64, Option<u64>)> {
    let text = response.headers().get("content-range")?.to_str().ok()?;
    let (range, whole) = text.trim().strip_prefix("bytes ")?.split_once('/')?;
    Some((range.split_once('-')?.0.trim().parse().ok()?, whole.trim().parse().ok()))
}
