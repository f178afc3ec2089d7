/* What the files of DIMSE share. */
#ifndef CTS_DICOM_DIMSE_HPP
#define CTS_DICOM_DIMSE_HPP

#include "dicom/net/store_scp.h"
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

/* What DIMSE goes over: TLS by the profile of BCP 195, or TCP as it is; neither waits for more to come. TLS where net
 * names PEM files. host: who the other side must prove to be, by its certificate; NULL on the side that listens, which
 * with tls_ca asks for any certificate signed by it. */
CtsStatus cts_transport_make(const CtsNet &net, T_ASC_NetworkRole role, const char *host,
                             std::unique_ptr<DcmTransportLayer> &transport, CtsError *err);

/* Ends what goes on over the layer's last connection: reading from it fails from now on. DCMTK has no other way out of
 * an object that comes, for what is thrown through it leaves its memory behind. */
void cts_transport_break(DcmTransportLayer &transport);

/* DCMTK's conditions, and what a peer wrote into them, on one line. */
std::string cts_one_line(const OFCondition &state);

/* "RLE Lossless (1.2.840.10008.1.2.5)" */
std::string cts_uid_words(const char *uid);

/* What an association goes over outlives it. */
struct CtsScuTransport {
    std::unique_ptr<DcmTransportLayer> transport;
};

/* The side that asks for an association. */
class CtsScu : protected CtsScuTransport, public DcmSCU
{
  public:
    /* To be offered: a model of queries, in the plain syntaxes; objects of a class. */
    void offer(const char *model);
    void offer(const char *sop_class, const OFList<OFString> &syntaxes, T_ASC_SC_ROLE role = ASC_SC_ROLE_DEFAULT);
    /* What helps where the peer takes nothing that is offered: " (`compress` none ...)". */
    std::string remedy;
    /* An association for what was offered. The failure's status is `fault`; *again: another try may do better. */
    CtsStatus associate(const CtsPeer &peer, const CtsNet &net, CtsStatus fault, bool *again, CtsError *err);
    void hang_up(bool in_peace);
    /* The answers to a query of one level (C-FIND), at most so many. */
    CtsStatus send_query(DcmDataset &query, size_t most, CtsError *err);
    std::vector<std::unique_ptr<DcmDataset>> answers;

  protected:
    OFCondition handleFINDResponse(const T_ASC_PresentationContextID, QRResponse *response, OFBool &goes_on) override;

  private:
    std::string offered; /* the first class and its syntaxes, for messages */
    size_t max_answers = 0;
    Uint16 query_status = STATUS_Success;
};

/* C-FIND: the series that a query names (PS3.4 C, study root). */
CtsStatus cts_dimse_find(const CtsPeer &peer, const CtsNet &net, const CtsSeriesQuery &query, CtsFound &found,
                         CtsError *err);

/* Receiver of the objects that a peer sends to a port of ours on request (C-MOVE): listens while it exists, at the address
 * by which the peer is reached, and accepts only the peer's own addresses and AE title. */
class CtsMoveListener
{
  public:
    CtsMoveListener(const CtsPeer &peer_, const CtsNet &net_, CtsFetchFolder &fetch_folder_)
        : peer(peer_), net(net_), fetch_folder(fetch_folder_)
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
    CtsFetchFolder &fetch_folder;
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

/* What a series of CT is made of on the network, and every way that ctsplat reads it. Captures are of modality CT too:
 * some peers fail at a series of theirs that they may not send, so they may when we fetch, and are passed over when the
 * files are read. */
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

#endif
