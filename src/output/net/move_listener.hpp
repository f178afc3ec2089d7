/* Where a peer stores what it was asked to send to a port of ours (C-MOVE): listens while it exists, at the address by
 * which the peer is reached, and takes from the peer's own addresses and AE title alone. */
#ifndef CTS_NET_MOVE_LISTENER_HPP
#define CTS_NET_MOVE_LISTENER_HPP

#include "output/net/accept.h"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <set>
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
    std::atomic<bool> done{false};
    std::thread thread; /* takes connections, of which each has a thread of its own */
    std::mutex lock;    /* of the inbox and what follows */
    std::condition_variable one_less;
    std::set<int> served; /* connections, each by a descriptor of our own */
    CtsStatus status = CTS_OK;
    CtsError error = {};

    CtsStatus find_peer(CtsError *err);
    CtsStatus listen(CtsError *err);
    bool is_peer(const sockaddr_storage &from) const;
    void run();
    void take_connection();
    void serve(int socket, int own);
    char *begin();
    bool grows(uint64_t n_bytes);
    CtsStoredAs keep(const char *path);
};

#endif
