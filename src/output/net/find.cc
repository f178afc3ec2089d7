#include "output/net/find.hpp"

#include "output/net/scu.hpp"

#include <cstdio>
#include <memory>
#include <vector>

namespace
{

/* Keeps what a peer answers, as long as it is not too much. */
class FindScu : public CtsScu
{
  public:
    std::vector<std::unique_ptr<DcmDataset>> answers;
    size_t most = 0;
    Uint16 status = STATUS_Success;

    /* Under a query of one level; a failure says why. */
    CtsStatus ask(DcmDataset &query, CtsError *err)
    {
        answers.clear();
        const OFCondition state = sendFINDRequest(
            findPresentationContextID(UID_FINDStudyRootQueryRetrieveInformationModel, ""), &query, nullptr);
        if (answers.size() > most)
            return cts_fail(err, CTS_ERR_READ, "more than %d series are found (narrow the query)", CTS_MOST_FOUND);
        if (state.bad())
            return cts_fail(err, CTS_ERR_READ, "the connection broke: %s", cts_one_line(state).c_str());
        if (status != STATUS_Success)
            return cts_fail(err, CTS_ERR_READ, "the peer refuses the query with status %04X",
                            static_cast<unsigned>(status));
        return CTS_OK;
    }

  protected:
    OFCondition handleFINDResponse(const T_ASC_PresentationContextID, QRResponse *response, OFBool &goes_on) override
    {
        goes_on = DICOM_PENDING_STATUS(response->m_status);
        if (!goes_on)
            status = response->m_status;
        if (goes_on && response->m_dataset) {
            answers.emplace_back(response->m_dataset);
            response->m_dataset = nullptr;
            goes_on = answers.size() <= most;
        }
        return EC_Normal;
    }
};

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

CtsStatus find_series(FindScu &scu, const CtsSeriesQuery &query, const CtsFoundSeries &study, CtsFound &found,
                      CtsError *err)
{
    DcmDataset keys;
    fill_series_query(keys, query, study.study_uid);
    scu.most = static_cast<size_t>(CTS_MOST_FOUND - found.n);
    CtsStatus st = scu.ask(keys, err);
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

CtsStatus find_studies(FindScu &scu, const CtsSeriesQuery &query, std::vector<CtsFoundSeries> &studies, CtsError *err)
{
    DcmDataset keys;
    fill_study_query(keys, query);
    scu.most = CTS_MOST_FOUND;
    const CtsStatus st = scu.ask(keys, err);
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
    std::unique_ptr<DcmTransportLayer> transport;
    std::vector<CtsFoundSeries> studies;
    FindScu scu;
    OFList<OFString> plain;
    CtsStatus st = cts_transport_make(net, NET_REQUESTOR, peer.host, transport, err);
    if (st)
        return st;
    plain.push_back(UID_LittleEndianExplicitTransferSyntax);
    plain.push_back(UID_LittleEndianImplicitTransferSyntax);
    cts_scu_set_up(scu, peer, net);
    scu.addPresentationContext(UID_FINDStudyRootQueryRetrieveInformationModel, plain);
    const OFCondition state = cts_scu_connect(scu, transport.get());
    if (state.bad())
        return cts_fail(err, CTS_ERR_READ, "no association with %s at %s port %d: %s", peer.aet, peer.host, peer.port,
                        cts_scu_refusal(state).c_str());
    st = find_studies(scu, query, studies, err);
    for (size_t i = 0; i < studies.size() && !st && !cts_net_stopped(&net); i++)
        st = find_series(scu, query, studies[i], found, err);
    cts_scu_hang_up(scu, st == CTS_OK);
    return st;
}
