/* Transport, associations and presentation contexts of DIMSE, for its C++ files. */
#pragma once

#include "dicom/net/answers.h"
#include "dicom/net/peer.h"
#include <atomic>
#include <condition_variable>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <dcmtk/dcmnet/assoc.h>
#include <dcmtk/dcmnet/dcmlayer.h>
#include <dcmtk/dcmnet/scu.h>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <sys/socket.h>
#include <thread>
#include <vector>

/* Creates the transport of DIMSE: TLS by the profile of BCP 195 where net names PEM files, else TCP; both without
 * Nagle's algorithm. host: the name that the other side's certificate must have; NULL on the listening side, which with
 * tls_ca requires any certificate signed by it. */
CtsStatus cts_transport_make(const CtsNet &net, T_ASC_NetworkRole role, const char *host,
                             std::unique_ptr<DcmTransportLayer> &transport, CtsError *err);

/* Aborts transfers over the layer's last connection: reading from it fails from now on. DCMTK has no other way to abort
 * the reception of an object, since exceptions thrown through it leak memory. */
void cts_transport_break(DcmTransportLayer &transport);

/* Text of DCMTK's condition, which may contain a peer's text, on one line. */
std::string cts_one_line(const OFCondition &state);

/* Name and UID, as "RLE Lossless (1.2.840.10008.1.2.5)". */
std::string cts_uid_words(const char *uid);

/* Base class, so that the transport outlives the association. */
struct CtsScuTransport {
    std::unique_ptr<DcmTransportLayer> transport;
};

/* Requestor of an association (SCU). */
class CtsScu : protected CtsScuTransport, public DcmSCU
{
  public:
    /* Adds a presentation context: a query model in the native syntaxes, or a SOP class. */
    void offer(const char *model);
    void offer(const char *sop_class, const OFList<OFString> &syntaxes, T_ASC_SC_ROLE role = ASC_SC_ROLE_DEFAULT);
    /* Advice for the case that the peer accepts no presentation context: " (`compress` none ...)". */
    std::string remedy;
    /* Opens the association. fault: status of a failure; *again: another attempt may succeed. */
    CtsStatus associate(const CtsPeer &peer, const CtsNet &net, CtsStatus fault, bool *again, CtsError *err);
    void hang_up(bool in_peace);
    /* Sends a query of one level (C-FIND), and takes its answers. */
    CtsStatus search(CtsSearch &of, CtsError *err);

  protected:
    OFCondition handleFINDResponse(const T_ASC_PresentationContextID, QRResponse *response, OFBool &goes_on) override;

  private:
    std::string offered;           /* the first class and its syntaxes, for messages */
    CtsSearch *searched = nullptr; /* while it runs */
    CtsError failure = {};         /* of taking an answer */
    Uint16 query_status = STATUS_Success;
};

/* C-FIND (PS3.4 C, study root) over a CtsScu (CtsAsk). */
extern "C" CtsStatus cts_dimse_search(void *scu, CtsSearch *search, CtsError *err);

/* Files of the objects that come in, over any number of connections, each with a thread. The first failure ends the
 * reception. */
class CtsReception
{
  public:
    CtsReception(CtsFetchFolder &folder_, const CtsNet &net_) : folder(folder_), net(net_)
    {
    }
    /* The path for the next object, to be freed with free(); NULL: no more are taken. */
    char *begin();
    /* It has n_bytes by now: where no more are taken, the transfer over this layer is aborted. */
    void grows(uint64_t n_bytes, DcmTransportLayer &transport);
    /* The object is complete; false: there is no room. */
    bool keep(const char *path);
    /* The first failure, or CTS_OK. */
    CtsStatus failure(CtsError *err) const;

  private:
    CtsFetchFolder &folder;
    const CtsNet &net;
    std::mutex lock;
    CtsError error = {};
};

/* Receiver of the objects that a peer sends to a port of ours on request (C-MOVE): listens while it exists, at the
 * address by which the peer is reached, and accepts only the peer's own addresses and AE title. */
class CtsMoveListener
{
  public:
    CtsMoveListener(const CtsPeer &peer_, const CtsNet &net_, CtsReception &reception_)
        : peer(peer_), net(net_), reception(reception_)
    {
    }
    ~CtsMoveListener();
    CtsMoveListener(const CtsMoveListener &) = delete;
    CtsMoveListener &operator=(const CtsMoveListener &) = delete;
    CtsStatus open(CtsError *err);
    /* Ends the reception once the peer has sent all objects. */
    void close();
    /* Why the first connection that was not served was refused; "" when there was none. After close(). */
    const std::string &refused() const
    {
        return refusal;
    }

  private:
    const CtsPeer &peer;
    const CtsNet &net;
    CtsReception &reception;
    int listener = -1;
    std::vector<sockaddr_storage> addresses; /* of the peer */
    std::atomic<bool> done{false};
    std::thread thread; /* accepts connections; each is served by a thread of its own */
    std::mutex lock;    /* of the following fields */
    std::condition_variable one_less;
    std::set<int> served; /* own descriptors of the connections being served */
    std::string refusal;

    CtsStatus find_peer(CtsError *err);
    CtsStatus listen(CtsError *err);
    bool is_peer(const sockaddr_storage &from) const;
    void run();
    void take_connection();
    void serve(int socket, int own);
};

/* SOP classes and transfer syntaxes of CT series. Captures have the modality CT too: some peers fail on a series of
 * which they may not send every object, so captures are accepted when fetching, and skipped when the files are read. */
inline const char *const cts_capture_classes[] = {UID_SecondaryCaptureImageStorage,
                                                  UID_MultiframeGrayscaleWordSecondaryCaptureImageStorage,
                                                  UID_MultiframeTrueColorSecondaryCaptureImageStorage};
inline const char *const cts_ct_classes[] = {UID_CTImageStorage, UID_EnhancedCTImageStorage,
                                             UID_LegacyConvertedEnhancedCTImageStorage};
inline const char *const cts_ct_syntaxes[] = {UID_LittleEndianExplicitTransferSyntax,
                                              UID_LittleEndianImplicitTransferSyntax,
                                              UID_BigEndianExplicitTransferSyntax,
                                              UID_JPEGProcess14SV1TransferSyntax,
                                              UID_JPEG2000LosslessOnlyTransferSyntax,
                                              UID_JPEGLSLosslessTransferSyntax,
                                              UID_RLELosslessTransferSyntax,
                                              UID_JPEGProcess14TransferSyntax,
                                              UID_DeflatedExplicitVRLittleEndianTransferSyntax,
                                              UID_JPEG2000TransferSyntax,
                                              UID_JPEGLSLossyTransferSyntax,
                                              UID_JPEGProcess2_4TransferSyntax,
                                              UID_JPEGProcess1TransferSyntax};
