"""A camera's frames to features: resize, scale and backbone as one module.

Knows nothing about weights, files or windows.
"""

from __future__ import annotations

from torch import Tensor, nn

from taxel.models.backbones.catalogue import find_backbone


class FrameNetwork(nn.Module):
    """Frames (n, h, w, 3) as a camera gives them → features (n, features).

    The resize is bilinear without smoothing, pixel centres at halves, as OpenCV's
    default and ONNX's "linear" do; every path of this project runs this one.

    Args:
        backbone: A module that `BACKBONES[name].build` made.
        name: Its name there, for the size that it takes.
        side_px: Height and width to resize to, pixels; the backbone's own unless given.
    """

    def __init__(self, backbone: nn.Module, name: str, side_px: int | None = None) -> None:
        super().__init__()
        row = find_backbone(name)
        self.backbone = backbone
        self.size_px = (side_px or row.height_px, side_px or row.width_px)

    def forward(self, frames: Tensor) -> Tensor:
        """Return features, shape (n, features), of frames (n, h, w, 3), R G B, uint8."""
        images = nn.functional.interpolate(
            frames.permute(0, 3, 1, 2).float(),
            self.size_px,
            mode="bilinear",
            align_corners=False,
            antialias=False,
        )
        features: Tensor = self.backbone(images)
        return features
