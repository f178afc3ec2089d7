/* Where a peer stores what it was asked to send to a port of ours (C-MOVE): listens while it exists, at the address by
 * which the peer is reached, and takes from the peer's own addresses and AE title alone. */
#ifndef CTS_NET_MOVE_LISTENER_HPP
#define CTS_NET_MOVE_LISTENER_HPP

#include "output/net/accept.h"

#include <atomic>
#include <mutex>
#include <sys/socket.h>
#include <thread>
#include <vector>

class CtsMoveListener
{
  public:
    CtsMoveListener(const CtsPeer &peer_, const CtsNet &net_, CtsInbox &inbox_) : peer(peer_), net(net_), inbox(inbox_)
    {
    }
    ~CtsMoveListener();
    CtsMoveListener(const CtsMoveListener &) = delete;
    CtsMoveListener &operator=(const CtsMoveListener &) = delete;
    CtsStatus open(CtsError *err);
    /* The peer has sent all: hangs up. Why something was not taken, or CTS_OK. */
    CtsStatus close(CtsError *err);

  private:
    const CtsPeer &peer;
    const CtsNet &net;
    CtsInbox &inbox;
    int listener = -1;
    std::vector<sockaddr_storage> addresses; /* of the peer */
    std::vector<int> waiting;                /* connections that have sent nothing yet */
    std::atomic<bool> done{false};
    std::mutex lock;
    int served = -1; /* a descriptor of our own for the connection that is served */
    CtsStatus status = CTS_OK;
    CtsError error = {};
    std::thread thread;

    CtsStatus find_peer(CtsError *err);
    CtsStatus listen(CtsError *err);
    bool is_peer(const sockaddr_storage &from) const;
    void run();
    void take_connection();
    void serve_ready();
    void serve(int socket);
    char *begin();
    bool grows(uint64_t n_bytes);
    CtsStoredAs keep(const char *path);
};

#endif
