/* The program ctsplat-net: one request of the library, whose socket's number is the argument. */
#include "dicom/dcmtk/start_dcmtk.h"
#include "dicom/net/wire.h"
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static volatile sig_atomic_t stop;
static int library; /* the socket */

/* A byte from the library is its request to stop; the end of its socket is its death. Signals, which reach the library
 * too, stay blocked as they are at the start. */
static void *watch(void *unused)
{
    char byte;
    (void)unused;
    while (cts_wire_read(library, &byte, 1))
        stop = 1;
    _exit(1);
}

/* Reports a file as sent; context: the first of the files' structures. */
static void on_sent(void *context, const char *path)
{
    const CtsOutgoingFile *const files = context;
    CtsNetAnswer answer = {.kind = CTS_NET_SENT};
    while (files[answer.number].path != path)
        answer.number++;
    cts_send_all(library, &answer, sizeof answer);
}

static void send_found(const CtsFound *found)
{
    CtsNetAnswer answer = {.kind = CTS_NET_FOUND};
    for (int i = 0; i < found->n; i++) {
        answer.found = found->items[i];
        cts_send_all(library, &answer, sizeof answer);
    }
}

static void send_diagnostics(const CtsDiagnostics *diagnostics)
{
    for (size_t i = 0; i < diagnostics->n; i++) {
        CtsNetAnswer answer = {.kind = CTS_NET_DIAGNOSTIC, .number = (int)diagnostics->items[i].id};
        snprintf(answer.result.error.text, sizeof answer.result.error.text, "%s", diagnostics->items[i].text);
        cts_send_all(library, &answer, sizeof answer);
    }
}

/* Runs the request; the last answer is returned. */
static CtsNetAnswer run_task(const CtsNetRequest *r)
{
    CtsReport report = {0};
    CtsNetAnswer answer = {.kind = CTS_NET_END};
    CtsError *const err = &answer.result.error;
    const CtsProtocol *const protocol = r->peer.web ? &cts_protocol_web : &cts_protocol_dimse;
    CtsNet net = r->net;
    net.stop = &stop;
    net.sent = on_sent;
    net.context = r->outgoing;
    net.report = &report;
    if (r->task == CTS_NET_SEND)
        protocol->send(&r->peer, &net, r->outgoing, r->n_outgoing, &answer.result);
    if (r->task == CTS_NET_FETCH) {
        answer.fetch_folder.folder = r->folder;
        err->status = protocol->fetch(&r->peer, &net, &r->query, &answer.fetch_folder, err);
    }
    if (r->task == CTS_NET_FIND) {
        CtsFound found = {0};
        err->status = protocol->find(&r->peer, &net, &r->query, &found, err);
        send_found(&found);
        cts_found_free(&found);
    }
    send_diagnostics(&report.diagnostics);
    cts_report_free(&report);
    return answer;
}

int main(int argc, char **argv)
{
    CtsNetRequest request;
    CtsNetAnswer answer = {.kind = CTS_NET_END};
    CtsError *const err = &answer.result.error;
    pthread_t watcher;
    if (argc != 2) {
        fputs("ctsplat-net is started by ctsplat\n", stderr);
        return 2;
    }
    library = atoi(argv[1]);
    if (!cts_wire_read_request(library, &request))
        return 1;
    if (pthread_create(&watcher, NULL, watch, NULL))
        cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    else if (!cts_dcm_start(err))
        answer = run_task(&request);
    return !cts_send_all(library, &answer, sizeof answer);
}
