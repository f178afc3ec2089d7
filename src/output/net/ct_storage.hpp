/* What a series of CT is made of on the network, and every way that ctsplat reads it. */
#ifndef CTS_NET_CT_STORAGE_HPP
#define CTS_NET_CT_STORAGE_HPP

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcuid.h>

/* Captures are of modality CT too: some peers fail at a series of theirs that they may not send, so they may when we
 * fetch, and are passed over when the files are read. */
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
