#include "dicom/net/store_scp.h"

#include "dicom/net/dimse.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmnet/dimse.h>
#include <dcmtk/dcmnet/dul.h>
#include <mutex>
#include <new>
#include <openssl/x509.h>
#include <unistd.h>
#include <vector>

namespace
{

struct Visitor {
    const CtsStoreScpRules &rules;
    CtsAssociationInfo &info;
    const int socket;
    bool given_up = false; /* ended by the rules, which have set the reason */
    T_ASC_Network *network = nullptr;
    T_ASC_Association *association = nullptr;
    std::unique_ptr<DcmTransportLayer> transport = {}; /* outlives both */

    ~Visitor()
    {
        if (association) {
            ASC_dropAssociation(association);
            ASC_destroyAssociation(&association);
        }
        if (network)
            ASC_dropNetwork(&network);
    }
};

void describe_end(CtsAssociationInfo &info, const std::string &how)
{
    std::snprintf(info.end, sizeof info.end, "%s", how.c_str());
}

/* DCMTK has one global for an external socket, which its network object and the first association use. */
OFCondition open_association(Visitor &v, DcmTransportLayer *transport)
{
    static std::mutex external_socket;
    const std::lock_guard<std::mutex> lock(external_socket);
    const int timeout_s = v.rules.net->timeout_s;
    dcmDisableGethostbyaddr.set(OFTrue);
    dcmExternalSocketHandle.set(v.socket);
    OFCondition state = ASC_initializeNetwork(NET_ACCEPTOR, 0, timeout_s, &v.network);
    if (state.good())
        state = ASC_setTransportLayer(v.network, transport, 0);
    if (state.good())
        state = ASC_receiveAssociation(v.network, &v.association, ASC_DEFAULTMAXPDU, nullptr, nullptr, OFTrue,
                                       DUL_NOBLOCK, timeout_s);
    dcmExternalSocketHandle.set(DCMNET_INVALID_SOCKET);
    return state;
}

void reject(Visitor &v, T_ASC_RejectParametersReason reason, const char *why)
{
    const T_ASC_RejectParameters rejected = {ASC_RESULT_REJECTEDPERMANENT, ASC_SOURCE_SERVICEUSER, reason};
    ASC_rejectAssociation(v.association, &rejected);
    describe_end(v.info, why);
}

bool check_titles(Visitor &v)
{
    CtsAssociationInfo &info = v.info;
    ASC_getAPTitles(v.association->params, info.calling_aet, sizeof info.calling_aet, info.called_aet,
                    sizeof info.called_aet, nullptr, 0);
    if (std::strcmp(info.called_aet, v.rules.net->own_aet) != 0)
        return reject(v, ASC_REASON_SU_CALLEDAETITLENOTRECOGNIZED, "refused: it calls another AE title"), false;
    if (!v.rules.allows(v.rules.context, info.calling_aet))
        return reject(v, ASC_REASON_SU_CALLINGAETITLENOTRECOGNIZED, "refused: its AE title is not allowed"), false;
    return true;
}

/* The subject of the certificate that the peer has shown. */
void describe_certificate(Visitor &v)
{
    const unsigned long n = ASC_getPeerCertificateLength(v.association);
    std::vector<unsigned char> der(n);
    if (n == 0 || ASC_getPeerCertificate(v.association, der.data(), n) != n)
        return;
    const unsigned char *at = der.data();
    X509 *const certificate = d2i_X509(nullptr, &at, static_cast<long>(n));
    if (certificate)
        X509_NAME_oneline(X509_get_subject_name(certificate), v.info.certificate, sizeof v.info.certificate);
    X509_free(certificate);
}

/* False when there is nothing to serve. */
bool acknowledge(Visitor &v)
{
    T_ASC_Parameters *const params = v.association->params;
    std::vector<const char *> classes(std::begin(cts_ct_classes), std::end(cts_ct_classes));
    std::vector<const char *> syntaxes(std::begin(cts_ct_syntaxes), std::end(cts_ct_syntaxes));
    const char *verification[] = {UID_VerificationSOPClass};
    if (v.rules.takes_captures)
        classes.insert(classes.end(), std::begin(cts_capture_classes), std::end(cts_capture_classes));
    OFCondition state = ASC_acceptContextsWithPreferredTransferSyntaxes(
        params, classes.data(), static_cast<int>(classes.size()), syntaxes.data(), static_cast<int>(syntaxes.size()));
    if (state.good()) /* native syntaxes only, which are listed first */
        state = ASC_acceptContextsWithPreferredTransferSyntaxes(params, verification, 1, syntaxes.data(), 2);
    if (state.good() && ASC_countAcceptedPresentationContexts(params) == 0) {
        reject(v, ASC_REASON_SU_NOREASON, "refused: it offers nothing that is taken");
        return false;
    }
    if (state.good())
        state = ASC_acknowledgeAssociation(v.association);
    if (state.bad())
        describe_end(v.info, "no association: " + cts_one_line(state));
    return state.good();
}

void on_store(void *context, T_DIMSE_StoreProgress *progress, T_DIMSE_C_StoreRQ *request, char *path, DcmDataset **,
              T_DIMSE_C_StoreRSP *response, DcmDataset **)
{
    Visitor &v = *static_cast<Visitor *>(context);
    if (!v.given_up && !v.rules.grows(v.rules.context, static_cast<uint64_t>(progress->progressBytes))) {
        v.given_up = true;
        cts_transport_break(*v.transport);
    }
    if (v.given_up)
        response->DimseStatus = STATUS_STORE_Refused_OutOfResources;
    if (v.given_up || progress->state != DIMSE_StoreEnd)
        return;
    static const DIC_US statuses[] = {STATUS_Success, STATUS_STORE_Error_DataSetDoesNotMatchSOPClass,
                                      STATUS_STORE_Refused_OutOfResources};
    const CtsStoredAs stored = v.rules.keep(v.rules.context, path, request->AffectedSOPInstanceUID);
    response->DimseStatus = statuses[stored];
    v.info.n_objects += stored == CTS_STORED;
    v.info.n_refused += stored != CTS_STORED;
    if (stored == CTS_STORED)
        v.info.n_bytes += static_cast<uint64_t>(progress->progressBytes);
}

OFCondition store(Visitor &v, T_ASC_PresentationContextID context, T_DIMSE_C_StoreRQ &request)
{
    char *const path = v.rules.begin(v.rules.context);
    v.given_up = !path;
    if (!path)
        return EC_IllegalCall;
    const OFCondition state = DIMSE_storeProvider(v.association, context, &request, path, OFTrue, nullptr, on_store, &v,
                                                  DIMSE_NONBLOCKING, v.rules.net->timeout_s);
    free(path);
    return state;
}

OFCondition answer(Visitor &v)
{
    T_ASC_PresentationContextID context = 0;
    T_DIMSE_Message message;
    const OFCondition state =
        DIMSE_receiveCommand(v.association, DIMSE_NONBLOCKING, v.rules.net->timeout_s, &context, &message, nullptr);
    if (state.bad())
        return state;
    if (message.CommandField == DIMSE_C_ECHO_RQ)
        return DIMSE_sendEchoResponse(v.association, context, &message.msg.CEchoRQ, STATUS_Success, nullptr);
    if (message.CommandField == DIMSE_C_STORE_RQ)
        return store(v, context, message.msg.CStoreRQ);
    return makeDcmnetCondition(DIMSEC_UNEXPECTEDREQUEST, OF_error, "it asks for what is not offered");
}

void serve(Visitor &v)
{
    OFCondition state = EC_Normal;
    while (state.good())
        state = answer(v);
    if (state == DUL_PEERREQUESTEDRELEASE) {
        ASC_acknowledgeRelease(v.association);
        return describe_end(v.info, "released");
    }
    if (state != DUL_PEERABORTEDASSOCIATION)
        ASC_abortAssociation(v.association);
    if (!v.given_up)
        describe_end(v.info, state == DUL_PEERABORTEDASSOCIATION ? "broken off by the peer"
                                                                 : "broken off: " + cts_one_line(state));
}

void receive(Visitor &v)
{
    CtsError err = {};
    if (cts_transport_make(*v.rules.net, NET_ACCEPTOR, nullptr, v.transport, &err)) {
        close(v.socket);
        return describe_end(v.info, err.text);
    }
    const OFCondition state = open_association(v, v.transport.get());
    if (state.bad())
        return describe_end(v.info, "no association: " + cts_one_line(state));
    describe_certificate(v);
    if (!check_titles(v) || !acknowledge(v))
        return;
    serve(v);
}

} // namespace

extern "C" {

void cts_store_scp_serve(const CtsStoreScpRules *rules, int socket, CtsAssociationInfo *info)
try {
    Visitor peer_process{*rules, *info, socket};
    receive(peer_process);
} catch (const std::bad_alloc &) {
    describe_end(*info, "broken off: out of memory");
} catch (...) {
    describe_end(*info, "broken off: unexpected failure in DCMTK");
}

CtsStatus cts_store_scp_check(const CtsNet *net, CtsError *err)
try {
    std::unique_ptr<DcmTransportLayer> transport;
    return cts_transport_make(*net, NET_ACCEPTOR, nullptr, transport, err);
} catch (...) {
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}
}
