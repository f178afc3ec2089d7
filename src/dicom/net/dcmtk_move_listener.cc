#include "dicom/net/dcmtk_dimse.hpp"

#include "dicom/net/listener.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmnet/scp.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <string>
#include <unistd.h>

namespace
{

/* TICK_MS: interval at which the listener sees that it is to end. MAX_SERVED: connections of the peer at a time, a
 * thread for each. */
enum { TICK_MS = 100, MAX_SERVED = 16 };

/* Serves one association on a socket of ours: verification (C-ECHO), and storage of CT (C-STORE) into files, unchanged.
 * DcmSCP bounds its times and checks its AE titles; it would listen at every address of the machine, for one
 * association after the other, so that accepting connections stays ours. */
class MoveScp : public DcmSCP
{
  public:
    MoveScp(CtsReception &reception_, const CtsPeer &peer_, const CtsNet &net_)
        : reception(reception_), peer(peer_), net(net_)
    {
    }
    void serve(int socket);
    std::string refusal; /* why the connection got no association; "" when it did */

  protected:
    OFBool checkCalledAETitleAccepted(const OFString &aet) override
    {
        if (aet != net.own_aet)
            refusal = std::string("it calls AE title ") + aet.c_str() + ", not " + net.own_aet +
                      " (set up the peer, or give `aet`)";
        return refusal.empty();
    }
    OFBool checkCallingAETitleAccepted(const OFString &aet) override
    {
        if (aet != peer.aet)
            refusal = std::string("its own AE title is ") + aet.c_str() + ", not " + peer.aet;
        return refusal.empty();
    }
    void refuseAssociation(DcmRefuseReasonType reason) override
    {
        if (refusal.empty())
            refusal = reason == DCMSCP_NO_PRESENTATION_CONTEXTS
                          ? "it offers no SOP class of CT in a transfer syntax that is read"
                          : "it asks for no association as DICOM has it";
        DcmSCP::refuseAssociation(reason);
    }
    void notifyAssociationRequest(const T_ASC_Parameters &, DcmSCPActionType &) override
    {
        pass_on();
    }

    void notifyRECEIVEProgress(const unsigned long n_bytes) override
    {
        reception.grows(n_bytes, *transport);
    }

    OFCondition handleIncomingCommand(T_DIMSE_Message *message, const DcmPresentationContextInfo &context) override
    {
        return message->CommandField == DIMSE_C_STORE_RQ ? store(message->msg.CStoreRQ, context.presentationContextID)
                                                         : DcmSCP::handleIncomingCommand(message, context);
    }

  private:
    CtsReception &reception;
    const CtsPeer &peer;
    const CtsNet &net;
    std::unique_ptr<DcmTransportLayer> transport = {};
    std::unique_lock<std::mutex> turn = {}; /* to use DCMTK's one global for an external socket */

    void offer();
    OFCondition store(T_DIMSE_C_StoreRQ &request, T_ASC_PresentationContextID context);

    /* The association has its socket: another thread may set the global. */
    void pass_on()
    {
        if (!turn.owns_lock())
            return;
        dcmExternalSocketHandle.set(DCMNET_INVALID_SOCKET);
        turn.unlock();
    }
};

void MoveScp::offer()
{
    OFList<OFString> syntaxes;
    for (const char *syntax : cts_ct_syntaxes)
        syntaxes.push_back(syntax);
    for (const char *sop_class : cts_ct_classes)
        addPresentationContext(sop_class, syntaxes);
    for (const char *sop_class : cts_capture_classes)
        addPresentationContext(sop_class, syntaxes);
    setEnableVerification();
}

OFCondition MoveScp::store(T_DIMSE_C_StoreRQ &request, T_ASC_PresentationContextID context)
{
    char *const path = reception.begin();
    if (!path)
        return EC_IllegalCall; /* ends the association */
    OFCondition state = receiveSTORERequest(request, context, path);
    if (state.good())
        state = sendSTOREResponse(context, request,
                                  reception.keep(path) ? STATUS_Success : STATUS_STORE_Refused_OutOfResources);
    free(path);
    return state;
}

void MoveScp::serve(int socket)
{
    static std::mutex external_socket;
    CtsError err = {};
    const Uint32 timeout_s = static_cast<Uint32>(net.timeout_s);
    if (cts_transport_make(net, NET_ACCEPTOR, nullptr, transport, &err)) {
        close(socket);
        refusal = err.text;
        return;
    }
    setAETitle(net.own_aet);
    setACSETimeout(timeout_s);
    setDIMSETimeout(timeout_s);
    setDIMSEBlockingMode(DIMSE_NONBLOCKING);
    setConnectionTimeout(timeout_s);
    setConnectionBlockingMode(DUL_NOBLOCK);
    setHostLookupEnabled(OFFalse);
    getConfig().setTransportLayer(transport.get());
    offer();
    turn = std::unique_lock<std::mutex>(external_socket);
    dcmExternalSocketHandle.set(socket);
    /* Not by DcmSCP's own listening, which sets the process' user, and so interrupts the other threads' reading. */
    T_ASC_Network *network = nullptr;
    OFCondition state = ASC_initializeNetwork(NET_ACCEPTOR, 0, net.timeout_s, &network);
    if (state.good())
        state = ASC_setTransportLayer(network, transport.get(), 0);
    if (state.good())
        state = waitForAssociationRQ(network);
    if (state.bad() && refusal.empty())
        refusal = cts_one_line(state);
    pass_on();
    ASC_dropNetwork(&network);
}

/* The address alone, without the port. */
std::string host_of(const sockaddr_storage &address)
{
    char host[80] = "";
    getnameinfo(reinterpret_cast<const sockaddr *>(&address), sizeof(sockaddr_in), host, sizeof host, nullptr, 0,
                NI_NUMERICHOST);
    return host;
}

/* The address of ours from which the peer is reached; nothing is sent to find out. "" when it cannot be. */
std::string own_address(const sockaddr_storage &to)
{
    sockaddr_storage own = {};
    socklen_t n = sizeof own;
    const int probe = socket(to.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const bool known = probe >= 0 &&
                       connect(probe, reinterpret_cast<const sockaddr *>(&to), sizeof(sockaddr_in)) == 0 &&
                       getsockname(probe, reinterpret_cast<sockaddr *>(&own), &n) == 0;
    if (probe >= 0)
        close(probe);
    return known ? host_of(own) : "";
}

} // namespace

CtsMoveListener::~CtsMoveListener()
{
    close();
}

CtsStatus CtsMoveListener::find_peer(CtsError *err)
{
    addrinfo hints = {}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_family = AF_INET; /* IPv4, as DCMTK 3.6.7 connects */
    const int why = getaddrinfo(peer.host, nullptr, &hints, &found);
    if (why)
        return cts_fail(err, CTS_ERR_READ, "%s: its address is not found: %s", peer.host, gai_strerror(why));
    for (const addrinfo *a = found; a; a = a->ai_next) {
        sockaddr_storage address = {};
        std::memcpy(&address, a->ai_addr, a->ai_addrlen);
        addresses.push_back(address);
    }
    freeaddrinfo(found);
    return CTS_OK;
}

CtsStatus CtsMoveListener::listen(CtsError *err)
{
    char where[100];
    const std::string own = own_address(addresses.front());
    std::snprintf(where, sizeof where, "%s:%d", own.c_str(), net.move_port);
    return own.empty() ? cts_fail(err, CTS_ERR_READ, "%s: cannot be reached", peer.host)
                       : cts_listen(where, &listener, err);
}

CtsStatus CtsMoveListener::open(CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (net.tls_ca && !net.tls_key)
        return cts_fail(err, CTS_ERR_USAGE,
                        "C-MOVE to a port of ours over TLS wants a certificate of ours (`tls-key`)");
    std::unique_ptr<DcmTransportLayer> transport; /* checks the files before a peer connects */
    if ((st = cts_transport_make(net, NET_ACCEPTOR, nullptr, transport, err)) || (st = find_peer(err)) ||
        (st = listen(err)))
        return st;
    thread = std::thread([this] { run(); });
    return CTS_OK;
}

bool CtsMoveListener::is_peer(const sockaddr_storage &from) const
{
    return std::any_of(addresses.begin(), addresses.end(),
                       [&](const sockaddr_storage &address) { return host_of(address) == host_of(from); });
}

void CtsMoveListener::take_connection()
{
    sockaddr_storage from = {};
    socklen_t n = sizeof from;
    const int socket = accept4(listener, reinterpret_cast<sockaddr *>(&from), &n, SOCK_CLOEXEC);
    const std::lock_guard<std::mutex> hold(lock);
    const bool is_known = socket >= 0 && is_peer(from), is_welcome = is_known && served.size() < MAX_SERVED;
    if (socket >= 0 && !is_welcome && refusal.empty())
        refusal = is_known ? "it opens too many at a time"
                           : "it comes from " + host_of(from) + ", which is not the peer's address";
    const int own = is_welcome ? fcntl(socket, F_DUPFD_CLOEXEC, 0) : -1;
    try {
        if (own >= 0) {
            served.insert(own);
            std::thread([this, socket, own] { serve(socket, own); }).detach();
            return;
        }
    } catch (...) { /* without memory the object is counted as missing */
        served.erase(own);
        ::close(own);
    }
    if (socket >= 0)
        ::close(socket);
}

void CtsMoveListener::run()
{
    while (!done) {
        pollfd ready = {listener, POLLIN, 0};
        if (poll(&ready, 1, TICK_MS) > 0)
            take_connection();
    }
}

void CtsMoveListener::serve(int socket, int own)
{
    /* A silent connection must not block others. */
    pollfd ready = {own, POLLIN, 0};
    poll(&ready, 1, -1);
    const bool is_silent = done; /* until close() shut it down */
    std::string why;
    try {
        MoveScp scp(reception, peer, net);
        scp.serve(socket);
        why = scp.refusal;
    } catch (...) { /* without memory the objects are counted as missing */
    }
    const std::lock_guard<std::mutex> hold(lock);
    if (!is_silent && refusal.empty())
        refusal = why;
    ::close(own);
    served.erase(own);
    one_less.notify_all();
}

/* All objects that the peer announced have arrived: do not wait for an association that it keeps open. */
void CtsMoveListener::close()
{
    done = true;
    if (thread.joinable())
        thread.join();
    if (listener >= 0)
        ::close(listener);
    listener = -1;
    std::unique_lock<std::mutex> hold(lock);
    for (const int own : served)
        shutdown(own, SHUT_RDWR);
    one_less.wait(hold, [this] { return served.empty(); });
}

char *CtsReception::begin()
{
    char *path = nullptr;
    const std::lock_guard<std::mutex> hold(lock);
    if (error.status || cts_net_stopped(&net))
        return nullptr;
    cts_fetch_folder_next(&folder, &path, &error);
    return path;
}

void CtsReception::grows(uint64_t n_bytes, DcmTransportLayer &transport)
{
    const std::lock_guard<std::mutex> hold(lock);
    if (error.status || cts_net_stopped(&net) || cts_fetch_folder_grows(&folder, n_bytes, &error))
        cts_transport_break(transport);
}

bool CtsReception::keep(const char *path)
{
    CtsError why = {};
    const std::lock_guard<std::mutex> hold(lock);
    const CtsStatus st = cts_fetch_folder_keep(&folder, path, &why);
    if (st && !error.status)
        error = why;
    return st == CTS_OK;
}

CtsStatus CtsReception::failure(CtsError *err) const
{
    if (error.status)
        *err = error;
    return error.status;
}
