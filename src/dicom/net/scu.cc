#include "dicom/net/dimse.hpp"

#include <cstdio>
#include <vector>

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

CtsStatus CtsScu::send_query(DcmDataset &query, size_t most, CtsError *err)
{
    answers.clear();
    max_answers = most;
    const OFCondition state =
        sendFINDRequest(findPresentationContextID(UID_FINDStudyRootQueryRetrieveInformationModel, ""), &query, nullptr);
    if (answers.size() > most)
        return cts_fail(err, CTS_ERR_READ, "more than %d series are found (narrow the query)", CTS_MAX_FOUND);
    if (state.bad())
        return cts_fail(err, CTS_ERR_READ, "the connection broke: %s", cts_one_line(state).c_str());
    if (query_status != STATUS_Success)
        return cts_fail(err, CTS_ERR_READ, "the peer refuses the query with status %04X",
                        static_cast<unsigned>(query_status));
    return CTS_OK;
}

OFCondition CtsScu::handleFINDResponse(const T_ASC_PresentationContextID, QRResponse *response, OFBool &goes_on)
{
    goes_on = DICOM_PENDING_STATUS(response->m_status);
    if (!goes_on)
        query_status = response->m_status;
    if (goes_on && response->m_dataset) {
        answers.emplace_back(response->m_dataset);
        response->m_dataset = nullptr;
        goes_on = answers.size() <= max_answers;
    }
    return EC_Normal;
}

namespace
{

void put(DcmDataset &query, const DcmTagKey &tag, const char *value)
{
    query.putAndInsertString(tag, value ? value : "");
}

template <size_t n> void take(DcmDataset &answer, const DcmTagKey &tag, char (&text)[n])
{
    OFString value;
    answer.findAndGetOFString(tag, value);
    std::snprintf(text, n, "%s", value.c_str());
}

void fill_study_query(DcmDataset &keys, const CtsSeriesQuery &q)
{
    put(keys, DCM_QueryRetrieveLevel, "STUDY");
    put(keys, DCM_StudyInstanceUID, q.study_uid);
    put(keys, DCM_AccessionNumber, q.accession);
    put(keys, DCM_PatientID, q.patient_id);
    put(keys, DCM_StudyDate, q.study_date);
}

void fill_series_query(DcmDataset &keys, const CtsSeriesQuery &q, const char *study_uid)
{
    put(keys, DCM_QueryRetrieveLevel, "SERIES");
    put(keys, DCM_StudyInstanceUID, study_uid);
    put(keys, DCM_SeriesInstanceUID, q.series_uid);
    put(keys, DCM_Modality, q.modality);
    put(keys, DCM_SeriesDescription, "");
    put(keys, DCM_NumberOfSeriesRelatedInstances, "");
}

CtsStatus find_series(CtsScu &scu, const CtsSeriesQuery &query, const CtsFoundSeries &study, CtsFound &found,
                      CtsError *err)
{
    DcmDataset keys;
    fill_series_query(keys, query, study.study_uid);
    CtsStatus st = scu.send_query(keys, static_cast<size_t>(CTS_MAX_FOUND - found.n), err);
    for (size_t i = 0; i < scu.answers.size() && !st; i++) {
        CtsFoundSeries series = study;
        Sint32 n = 0;
        take(*scu.answers[i], DCM_SeriesInstanceUID, series.series_uid);
        take(*scu.answers[i], DCM_Modality, series.modality);
        take(*scu.answers[i], DCM_SeriesDescription, series.description);
        scu.answers[i]->findAndGetSint32(DCM_NumberOfSeriesRelatedInstances, n);
        series.n_objects = n;
        st = cts_found_add(&found, &series, err);
    }
    return st;
}

CtsStatus find_studies(CtsScu &scu, const CtsSeriesQuery &query, std::vector<CtsFoundSeries> &studies, CtsError *err)
{
    DcmDataset keys;
    fill_study_query(keys, query);
    const CtsStatus st = scu.send_query(keys, CTS_MAX_FOUND, err);
    for (size_t i = 0; i < scu.answers.size() && !st; i++) {
        CtsFoundSeries study = {};
        take(*scu.answers[i], DCM_StudyInstanceUID, study.study_uid);
        take(*scu.answers[i], DCM_StudyDate, study.study_date);
        if (cts_uid_is_valid(study.study_uid))
            studies.push_back(study);
    }
    return st;
}

} // namespace

CtsStatus cts_dimse_find(const CtsPeer &peer, const CtsNet &net, const CtsSeriesQuery &query, CtsFound &found,
                         CtsError *err)
{
    std::vector<CtsFoundSeries> studies;
    CtsScu scu;
    scu.offer(UID_FINDStudyRootQueryRetrieveInformationModel);
    CtsStatus st = scu.associate(peer, net, CTS_ERR_READ, nullptr, err);
    if (st)
        return st;
    st = find_studies(scu, query, studies, err);
    for (size_t i = 0; i < studies.size() && !st && !cts_net_stopped(&net); i++)
        st = find_series(scu, query, studies[i], found, err);
    scu.hang_up(st == CTS_OK);
    return st;
}
