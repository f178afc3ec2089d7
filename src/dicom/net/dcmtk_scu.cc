#include "dicom/net/dcmtk_dimse.hpp"
#include "dicom/net/store_answer.h"

/* A peer that accepts only known callers does not say more than that it rejects this one. */
static std::string refusal(const OFCondition &state)
{
    std::string text = cts_one_line(state);
    if (text.find("Rejected") != std::string::npos)
        text += " (the peer must know the AE title that `aet` gives, and its own must be the one asked for)";
    if (state.module() == OFM_dcmtls)
        text += " (the peer's certificate must be signed by `tls-ca`, and name the host as it was asked for)";
    return text;
}

std::string cts_uid_words(const char *uid)
{
    return std::string(dcmFindNameOfUID(uid, "unknown")) + " (" + uid + ")";
}

void CtsScu::offer(const char *sop_class, const OFList<OFString> &syntaxes, T_ASC_SC_ROLE role)
{
    if (offered.empty()) {
        offered = cts_uid_words(sop_class);
        const char *joint = " in ";
        for (const OFString &syntax : syntaxes) {
            offered += joint + cts_uid_words(syntax.c_str());
            joint = " or ";
        }
    }
    addPresentationContext(sop_class, syntaxes, role);
}

void CtsScu::offer(const char *model)
{
    OFList<OFString> plain;
    plain.push_back(UID_LittleEndianExplicitTransferSyntax);
    plain.push_back(UID_LittleEndianImplicitTransferSyntax);
    offer(model, plain);
}

CtsStatus CtsScu::associate(const CtsPeer &peer, const CtsNet &net, CtsStatus fault, bool *again, CtsError *err)
{
    const CtsStatus st = cts_transport_make(net, NET_REQUESTOR, peer.host, transport, err);
    if (st)
        return st;
    setAETitle(net.own_aet);
    setPeerAETitle(peer.aet);
    setPeerHostName(peer.host);
    setPeerPort(static_cast<Uint16>(peer.port));
    setConnectionTimeout(net.timeout_s);
    setACSETimeout(static_cast<Uint32>(net.timeout_s));
    setDIMSETimeout(static_cast<Uint32>(net.timeout_s));
    setDIMSEBlockingMode(DIMSE_NONBLOCKING);
    OFCondition state = initNetwork();
    if (state.good())
        state = useSecureConnection(transport.get());
    if (state.good())
        state = negotiateAssociation();
    if (state.good())
        return CTS_OK;
    if (again)
        *again = state.module() != OFM_dcmtls && state != NET_EC_NoAcceptablePresentationContexts;
    if (state == NET_EC_NoAcceptablePresentationContexts)
        return cts_fail(err, fault, "%s at %s port %d takes nothing that is offered, such as %s%s", peer.aet, peer.host,
                        peer.port, offered.c_str(), remedy.c_str());
    return cts_fail(err, fault, "no association with %s at %s port %d: %s", peer.aet, peer.host, peer.port,
                    refusal(state).c_str());
}

void CtsScu::hang_up(bool in_peace)
{
    if (isConnected() && in_peace)
        releaseAssociation();
    else if (isConnected())
        abortAssociation();
}

static DcmTagKey tag_of(int key)
{
    return {static_cast<Uint16>(cts_key_rows[key].tag >> 16), static_cast<Uint16>(cts_key_rows[key].tag & 0xffff)};
}

CtsStatus CtsScu::search(CtsSearch &of, CtsError *err)
{
    DcmDataset query;
    query.putAndInsertString(DCM_QueryRetrieveLevel, of.of_series ? "SERIES" : "STUDY");
    for (int k = 0; k < CTS_N_KEYS; k++) {
        const char *const key = cts_search_key(&of, static_cast<CtsQueryKey>(k));
        if (key)
            query.putAndInsertString(tag_of(k), key);
    }
    searched = &of;
    failure = {};
    const OFCondition state =
        sendFINDRequest(findPresentationContextID(UID_FINDStudyRootQueryRetrieveInformationModel, ""), &query, nullptr);
    if (failure.status)
        return cts_fail(err, failure.status, "%s", failure.text);
    if (state.bad())
        return cts_fail(err, CTS_ERR_READ, "the connection broke: %s", cts_one_line(state).c_str());
    if (query_status != STATUS_Success)
        return cts_fail(err, CTS_ERR_READ, "the peer refuses the query with status %04X%s", query_status,
                        cts_status_words(query_status));
    return CTS_OK;
}

/* Texts that cannot be converted stay as they are. */
OFCondition CtsScu::handleFINDResponse(const T_ASC_PresentationContextID, QRResponse *response, OFBool &goes_on)
{
    goes_on = DICOM_PENDING_STATUS(response->m_status);
    if (!goes_on)
        query_status = response->m_status;
    if (response->m_status == STATUS_FIND_Pending_WarningUnsupportedOptionalKeys)
        searched->warning = "status FF01";
    if (goes_on && response->m_dataset) {
        CtsAnswer answer = {};
        response->m_dataset->convertToUTF8();
        for (int k = 0; k < CTS_N_KEYS; k++) {
            OFString value;
            response->m_dataset->findAndGetOFStringArray(tag_of(k), value);
            cts_answer_add(&answer, static_cast<CtsQueryKey>(k), value.c_str());
        }
        cts_search_take(searched, &answer, &failure);
        goes_on = failure.status == CTS_OK;
    }
    return EC_Normal;
}

CtsStatus cts_dimse_search(void *scu, CtsSearch *search, CtsError *err)
{
    return static_cast<CtsScu *>(scu)->search(*search, err);
}
