// A one-time sign-in link for one more browser: made one at a time, shown until it is closed.

import { request } from "../core/api.js";
import { copied, element } from "../core/dom.js";

export class Invitation {
  constructor() {
    this.reach = "";
    this.role = ""; // of the link that is shown
    this.isAsking = false;
    this.note = element("p", { role: "status" });
    this.link = element("input", {
      readOnly: true,
      hidden: true,
      ariaLabel: "one-time link",
      onfocus: () => this.link.select(),
    });
    this.picture = element("img", { alt: "QR code of the link", hidden: true });
    this.copy = element("button", { type: "button", onclick: () => this.copied() }, "Copy");
    this.another = element(
      "button",
      {
        type: "button",
        title: "create another link; this one stays valid",
        onclick: () => this.make(this.role),
      },
      "Another",
    );
    this.place = element(
      "div",
      { className: "invitation", hidden: true },
      this.note,
      this.link,
      this.picture,
      element(
        "div",
        { className: "acts" },
        this.copy,
        this.another,
        element("button", { type: "button", onclick: () => this.close() }, "Close"),
      ),
    );
    this.place.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.close();
    });
  }

  // The link for this role that is shown already, else a new one.
  show(role) {
    if (this.isAsking) return;
    if (role === this.role && this.link.value) this.link.focus();
    else this.make(role);
  }

  async make(role) {
    if (this.isAsking) return;
    this.isAsking = true;
    this.forget();
    this.role = role;
    this.place.hidden = false;
    this.note.textContent = "Requesting a link …";
    try {
      const { url, here_only: isHereOnly, picture } = await request("POST", "/api/invitations", { role });
      this.link.value = url;
      this.reach = isHereOnly ? " It opens on this computer only: start quadlab with --host for others." : "";
      this.picture.src = picture;
      this.picture.hidden = !picture;
      this.link.hidden = this.copy.disabled = this.another.disabled = false;
      await this.copied();
    } catch (error) {
      this.note.textContent = error.message;
    } finally {
      this.isAsking = false;
    }
  }

  // Said only where it was: without https, browsers give no clipboard.
  async copied() {
    const isCopied = await copied(this.link.value);
    this.note.textContent =
      `A link for one ${this.role}, for one ` +
      `use${isCopied ? "; copied to the clipboard" : ""}.${this.reach}`;
    if (!isCopied) this.link.focus();
  }

  close() {
    this.place.hidden = true;
    this.forget();
  }

  forget() {
    this.role = this.link.value = "";
    this.link.hidden = this.picture.hidden = this.copy.disabled = this.another.disabled = true;
  }
}
