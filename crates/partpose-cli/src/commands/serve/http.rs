//! Connections: how they are taken, how long they may idle, and how they end.

use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};

use crate::report::note;

use super::routes::Server;

/// Most connections at once; more wait to be taken.
const MOST_CONNECTIONS: usize = 1024;
/// Threads that read and write; the work is done by others.
const THREADS: usize = 2;
/// How long to wait after a failure to take a connection, such as for want of file handles.
const PAUSE: Duration = Duration::from_millis(100);

/// Serves until a signal asks to stop and what was admitted is answered; `bound` hears the address.
pub(super) fn serve(
    address: SocketAddr,
    server: Server,
    bound: &dyn Fn(SocketAddr),
) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(THREADS)
        .enable_all()
        .build()
        .context("cannot start the threads of the server")?;
    let outcome = runtime.block_on(async {
        let listener = TcpListener::bind(address)
            .await
            .with_context(|| format!("cannot listen on {address}"))?;
        bound(listener.local_addr()?);
        accept(listener, Arc::new(server), stop_signal()?).await;
        anyhow::Ok(())
    });
    // What did not end within its time is given up.
    runtime.shutdown_timeout(PAUSE);
    outcome
}

/// Resolves at ctrl-c, and where there is such a thing at SIGTERM.
fn stop_signal() -> anyhow::Result<impl Future<Output = ()>> {
    #[cfg(unix)]
    let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
    Ok(async move {
        let interrupt = tokio::signal::ctrl_c();
        #[cfg(unix)]
        tokio::select! {
            _ = interrupt => {}
            _ = terminate.recv() => {}
        }
        #[cfg(not(unix))]
        let _ = interrupt.await;
    })
}

/// Takes connections until `stop`, then waits for those that are open.
pub(super) async fn accept(
    listener: TcpListener,
    server: Arc<Server>,
    stop: impl Future<Output = ()>,
) {
    let room = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    let (stopping, stopped) = watch::channel(false);
    let mut stop = pin!(stop);
    loop {
        let next = async {
            let permit = Arc::clone(&room).acquire_owned().await;
            (permit, listener.accept().await)
        };
        let (permit, accepted) = tokio::select! {
            () = &mut stop => break,
            next = next => next,
        };
        let Ok((stream, _)) = accepted else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let (server, stopped) = (Arc::clone(&server), stopped.clone());
        tokio::spawn(async move {
            connection(stream, &server, stopped).await;
            drop(permit);
        });
    }
    drop(listener);
    note("stopping: what was admitted is still answered");
    // Connections hold receivers until they end.
    drop(stopped);
    let _ = stopping.send(true);
    let _ = tokio::time::timeout(2 * server.time(), stopping.closed()).await;
}

async fn connection(stream: TcpStream, server: &Server, mut stopped: watch::Receiver<bool>) {
    // Answers are whole; there is nothing to wait for.
    let _ = stream.set_nodelay(true);
    let service = service_fn(|request| server.answer(request));
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(server.time())
        .serve_connection(TokioIo::new(stream), service);
    let mut connection = pin!(connection);
    tokio::select! {
        // A client that breaks off is nobody's loss.
        _ = connection.as_mut() => return,
        _ = stopped.wait_for(|stopped| *stopped) => connection.as_mut().graceful_shutdown(),
    }
    let _ = connection.await;
}
